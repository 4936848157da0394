"""Receives and stores, nothing else.

The process writes the event log itself instead of driving the wheel's lcm-logger. Measured side by
side with `klab bench logger --camera-rate-hz 2400`, ten times the paper's cameras, for a minute on
two busy cores: no message lost by either, 16 % of a core and 55 MB here, 10 % and 4 MB there. Then
both were stopped five times for 0.2 s each, as a stall of the machine does: none of 60893 camera
frames missing here, 1497 there, because lcm-logger keeps 30 messages of a subscription, and here
nothing bounds the queue. For those 6 % of a core, this logger hands everything to the disk ten
times a second (fsync, so that power loss costs no more than SIGKILL), counts gaps by sequence
numbers and says so while it records, begins a next file when one is large, keeps whole events and
says why when a disk refuses, and goes on behind the log of an interrupted session. What it writes
is the same: a standard LCM event log.
"""
