"""ISO-MME (ISO/TS 13499): crash test data as text, one folder a test."""

from mcstudy.measurement.isomme.files import (
    FILTERS,
    MISSING,
    Channel,
    ChannelFile,
    Test,
    find_tests,
    read_test,
)
from mcstudy.measurement.isomme.selection import HeadSignal, head_acceleration
from mcstudy.measurement.isomme.writing import write_test

__all__ = [
    "FILTERS",
    "MISSING",
    "Channel",
    "ChannelFile",
    "HeadSignal",
    "Test",
    "find_tests",
    "head_acceleration",
    "read_test",
    "write_test",
]
