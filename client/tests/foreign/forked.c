/* forked ROOT TRAIN MODE: a controller with both ends open forks a child.
 * MODE: exit: the child ends; close: it uses and closes the parent's ends, and opens its own;
 * stay: it goes on while the parent is killed. */
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "dynocar.h"

static void drive(dynocar_publisher *publisher, int samples)
{
    int refused = 0;
    for (int i = 0; i < samples; i++) {
        struct timespec pause = {0, 2000000};
        dynocar_train_sample sample = dynocar_sample_empty();
        sample.time_ns = dynocar_monotonic_now_ns();
        refused += dynocar_publisher_publish(publisher, &sample) != DYNOCAR_OK;
        nanosleep(&pause, NULL);
    }
    printf("refused %d\n", refused);
    fflush(stdout);
}

static void use_what_is_the_parents(const char *root, unsigned long train, dynocar_publisher *publisher,
                                    dynocar_reader *reader)
{
    char words[DYNOCAR_MESSAGE_BYTES];
    dynocar_reader *own = NULL;
    dynocar_train_sample sample = dynocar_sample_empty();
    uint64_t refused;
    printf("child %d", dynocar_publisher_publish(publisher, &sample));
    printf(" %d", dynocar_publisher_flush(publisher, 0, NULL));
    printf(" %d", dynocar_publisher_start_run(publisher));
    printf(" %d", dynocar_reader_poll(reader, NULL));
    printf(" %d", dynocar_reader_refused(reader, &refused));
    printf(" %d", dynocar_publisher_close(publisher));
    printf(" %d\n", dynocar_reader_close(reader));
    printf("own %d", dynocar_reader_open(root, train, &own, words, sizeof words));
    printf(" %d", dynocar_reader_poll(own, NULL));
    printf(" %d\n", dynocar_reader_close(own));
    fflush(stdout);
}

int main(int count, char **arguments)
{
    const char *root = arguments[1], *mode = arguments[count - 1];
    unsigned long train = strtoul(arguments[2], NULL, 10);
    char words[DYNOCAR_MESSAGE_BYTES];
    dynocar_publisher *publisher = NULL;
    dynocar_reader *reader = NULL;
    pid_t child;
    if (dynocar_publisher_open(root, train, &publisher, words, sizeof words)
        || dynocar_reader_open(root, train, &reader, words, sizeof words)) {
        puts(words);
        return 1;
    }
    drive(publisher, 50);
    child = fork();
    if (child == 0) {
        if (!strcmp(mode, "close"))
            use_what_is_the_parents(root, train, publisher, reader);
        if (!strcmp(mode, "stay")) {
            fclose(stdout);
            sleep(60);
        }
        exit(0);
    }
    if (!strcmp(mode, "stay")) {
        drive(publisher, 100);
        printf("process %d\n", (int)child);
        fflush(stdout);
        kill(getpid(), SIGKILL);
    }
    waitpid(child, NULL, 0);
    drive(publisher, 100);
    printf("closed %d", dynocar_publisher_close(publisher));
    printf(" %d\n", dynocar_reader_close(reader));
    return 0;
}
