"""From session logs to data sets: decoding, segments, velocities, pairs, and their files."""
