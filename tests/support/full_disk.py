"""A full disk, which a limit on the size of files simulates."""

from contextlib import contextmanager


@contextmanager
def full_disk(limit):
    """Let no file of this process grow beyond ``limit`` bytes; Python ignores the signal, so that writing fails."""
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
