"""Session logs whose cameras lie, made of logs whose cameras do not."""

import lcmtypes
from koopman_lab.config.simulation import PlannedFault
from koopman_lab.eventlog.eventlog import read_events
from koopman_lab.eventlog.logwriter import EventLogWriter
from onboard.plant.cameras.lies import Lies

CAMERAS = "MOCAP_POSE"


def lying_log(source, kind, destination, *, at_s=2.0, leave_out=(), **details):
    """Write a log whose cameras tell a lie of the emulation from ``at_s`` on.

    Channels whose suffix is in ``leave_out`` are left out. Frames are numbered anew, so that one
    that is sent twice has two numbers.
    """
    lies = sequence = None
    with EventLogWriter(destination) as log:
        for event in read_events(source):
            suffix = event.channel.split("_", 1)[1]
            if suffix in leave_out:
                continue
            if suffix != CAMERAS:
                log.write(event.channel, event.data, event.timestamp_us)
                continue
            frame = lcmtypes.mocap_pose_t.decode(event.data)
            if lies is None:
                fault = PlannedFault(kind=kind, at_s=at_s, **details)
                lies, sequence = Lies([fault], frame.utime), frame.sequence
            pose = (frame.x1_m, frame.x2_m, frame.theta_rad)
            for utime, seen, valid in lies.told((frame.utime, pose, frame.tracking_valid)):
                frame.utime, frame.tracking_valid, frame.sequence = utime, valid, sequence
                frame.x1_m, frame.x2_m, frame.theta_rad = seen
                sequence += not lies.sequence_stuck
                log.write(event.channel, frame.encode(), event.timestamp_us)
    return destination
