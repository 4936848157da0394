"""Units between the wire and the inside: times on the wire are int64 microseconds."""

US_PER_S = 1_000_000
