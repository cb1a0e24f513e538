"""Drops readers and publishers without closing them, then holds as many readers as there are places."""

import gc
import sys
import threading

import dynocar


def drop_in_another_thread(reader):
    """The reader's own thread, this one, closes it when it opens its next end."""
    held = [reader]
    thread = threading.Thread(target=held.clear)
    del reader
    thread.start()
    thread.join()


def main(root, train):
    for _ in range(100):
        dynocar.SnapshotReader(train, root)
        dynocar.SamplePublisher(train, root)
    for _ in range(50):
        drop_in_another_thread(dynocar.SnapshotReader(train, root))
    for _ in range(100):
        cycle = [dynocar.SnapshotReader(train, root)]
        cycle.append(cycle)
        del cycle
        gc.collect()
    for _ in range(50):
        with dynocar.SnapshotReader(train, root) as reader:
            reader.close()

    held = []
    try:
        while len(held) < 100:
            held.append(dynocar.SnapshotReader(train, root))
    except dynocar.DynocarError as error:
        print(f"{len(held)} places, then {error.code.name}: {error}")
    held.pop().close()
    dynocar.SnapshotReader(train, root).close()


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
