# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Thresholds of the faults of a grip, each with the runs that set it.

- Loss: an innovation that is inconsistent by `MAX_DEVIATIONS` and longer than `JUMP_LENGTH`.
- Slip: pose corrections, load and delay of more than `MAX_DEVIATIONS`, or `ASSUMED_DEVIATIONS`
  after an assumed start, see `GripBelief.slip_deviations`.
- Oscillation: `SWING_COUNT` half periods without decay, each larger than `MIN_SWING`, than
  `MAX_DEVIATIONS` of the noise, and than `TRAVEL_SHARE` of the travel, see `swing_watch`.

The runs of oscillations are those of the linear loop of `swing_watch` at 50 Hz, with a gain for
omega = 12 rad/s and a damping ratio of 0.02: a heavy object has a true frequency of 0.3 omega, at
which the loop is unstable, and a shaken one is moved by its client with omega / 2.2.
"""

import math

#: Number of standard deviations [-] of an inconsistent innovation, of slip, and of a swing in
#: noise. One of 60000 valid poses exceeds it. An object that slips by 30 mm/s is stopped after
#: 9 mm; after 3.6 mm with a third, but white noise of 1 mm is then reported as an oscillation 83
#: times in 20 min; after 25 mm with three times.
MAX_DEVIATIONS = 5.0
#: The same of slip after an assumed start [-]. In many assumed starts nothing is gripped: this
#: shows after 9 to 16 mm of path; with `MAX_DEVIATIONS` it shows after 24 mm.
ASSUMED_DEVIATIONS = 3.5
#: Intervals over which corrections are summed to detect slip [s]. With a third or three times, a
#: slip of 5 mm/s is reported after 7.8 or 7.9 mm instead of 7.4 mm.
SUM_INTERVALS = (0.2, 0.6, 1.5, 3.0)
#: Length of an inconsistent innovation above which the object counts as lost [m]. With a third, a
#: jump of 12 mm within the grip would be a loss; with three times, a jump of 50 mm would be a
#: slip, after which the squeeze is controlled on.
JUMP_LENGTH = 0.02
#: Lowest natural frequency that is assumed if it is unknown [rad/s].
DEFAULT_FREQUENCY = 2.4
#: Smallest difference between a maximum and a minimum of the pose, without the part by roller
#: travel, that counts as an oscillation [m]. The heavy object swings by 2.5 mm when it is stopped;
#: by 0.8 mm with a third, by 7.8 mm with three times.
MIN_SWING = 0.0015
#: The same, relative to the commanded travel since the last extremum [-]. Client-driven motion
#: with the frequency w bends the tubes by (w / omega)^2 of its amplitude, which is less for
#: motions slower than omega / 2. With a third, the shaken object is stopped 32 times in 20 s.
TRAVEL_SHARE = 0.25
#: Longest half period of an oscillation, in units of pi / omega [-], and in seconds. The gain for
#: omega makes an object swing whose true frequency is below 0.46 omega, because it is heavier than
#: in the model; in MuJoCo, with damping, below 0.23 omega. With a third of either bound, the heavy
#: object swings by 0.2 m undetected; with three times, slow drift of the estimates could count.
MAX_SWING_PHASE, MAX_SWING_TIME = 5.5, 2.0 * math.pi / DEFAULT_FREQUENCY
#: Smallest number of poses in a half period [-]; with fewer poses, a swing is not resolved. At
#: 50 Hz, neither a third nor three times changes a run.
MIN_SWING_POSES = 3
#: Number of successive half periods after which an oscillation is detected [-]. With 1, a drift to
#: and fro by 8 mm with half periods of 3.5 s is reported 17 times in 60 s; with 9, the heavy
#: object swings by 7.8 mm.
SWING_COUNT = 3
#: Smallest ratio of the amplitudes of successive half periods [-]. Swings that decay by 6 % are no
#: oscillation, swings that decay by 3.5 % are one.
MIN_SWING_RATIO = 0.95
#: Smallest return behind the last of these half periods, relative to its amplitude [-]. A pull on
#: the object and its end are two half periods; without this return they would be an oscillation
#: after any motion to and fro.
MIN_RETURN_SHARE = 0.5
#: Time at rest after an oscillation [s]; each oscillation also halves the gain.
REST_TIME = 1.0
