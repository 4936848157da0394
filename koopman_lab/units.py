"""Units of what messages hold: times are int64 microseconds, encoder counters wrap at 32 bit."""

US_PER_S = 1_000_000
PPM = 1e-6
COUNTER_RANGE = 1 << 32
"""Encoder counters are 32 bit wide on the wire."""
HALF_RANGE = COUNTER_RANGE // 2


def wrap_counter(counts: int) -> int:
    """Return counts as a signed 32-bit counter shows them."""
    if -HALF_RANGE <= counts < HALF_RANGE:
        return counts
    return (counts + HALF_RANGE) % COUNTER_RANGE - HALF_RANGE
