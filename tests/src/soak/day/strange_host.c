/* A host whose wall clock is wrong and whose disk fills, for a program that is started with this
 * before the C library. How wrong and how full stands in the file that STRANGE_HOST names: seconds
 * that the wall clock is ahead, for the dates of those files too, then bytes that files below STRANGE_FOLDER may still take, -1 for
 * as many as they like. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

static struct {
    _Atomic int64_t ahead_s;
    _Atomic int64_t free_bytes;
} *strange;
static const char *folder;
static int (*usual_clock)(clockid_t, struct timespec *);

__attribute__((constructor)) static void meet(void) {
    const char *name = getenv("STRANGE_HOST");
    folder = getenv("STRANGE_FOLDER");
    usual_clock = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
    int file = name && folder ? open(name, O_RDWR | O_CLOEXEC) : -1;
    if (file < 0) {
        return;
    }
    void *page = mmap(NULL, sizeof *strange, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    close(file);
    if (page != MAP_FAILED) {
        strange = page;
    }
}

int clock_gettime(clockid_t clock, struct timespec *now) {
    int result = usual_clock ? usual_clock(clock, now) : (int)syscall(SYS_clock_gettime, clock, now);
    if (result == 0 && clock == CLOCK_REALTIME && strange) {
        now->tv_sec += strange->ahead_s;
    }
    return result;
}

static int is_below_folder(int file) {
    char link[64], path[PATH_MAX];
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    ssize_t length = readlink(link, path, sizeof path);
    size_t least = strlen(folder);
    return length > (ssize_t)least && memcmp(path, folder, least) == 0;
}

ssize_t write(int file, const void *bytes, size_t count) {
    if (strange && strange->free_bytes >= 0 && is_below_folder(file)) {
        int64_t left = strange->free_bytes;
        if (left <= 0) {
            errno = ENOSPC;
            return -1;
        }
        count = (int64_t)count < left ? count : (size_t)left;
        strange->free_bytes -= (int64_t)count;
    }
    ssize_t written = syscall(SYS_write, file, bytes, count);
    if (written > 0 && strange && strange->ahead_s && is_below_folder(file)) {
        /* A file bears the date of the host's clock. */
        struct timespec dates[2] = {{.tv_nsec = UTIME_OMIT}, {0}};
        clock_gettime(CLOCK_REALTIME, &dates[1]);
        futimens(file, dates);
    }
    return written;
}
