"""Where the tests' motor loops write down their stops."""

from koopman_lab.errors import LabStateError


class MemoryStore:
    """A disk that outlasts the program, and that can be made to fail."""

    def __init__(self, record=None):
        self.record = record
        self.readable = self.writable = True
        self.writes = 0

    def read(self):
        if not self.readable:
            raise LabStateError("cannot be read")
        return self.record

    def write(self, record):
        if not self.writable:
            raise LabStateError("cannot be written")
        self.record = record
        self.writes += 1
