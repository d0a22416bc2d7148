# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Reference results of membrane finite elements for the tube of Fig. 6.

The model is a nonlinear membrane (St. Venant-Kirchhoff about the inflated state) with follower
pressure and clamped ends. A rigid cylinder without friction is pressed 10 mm into the middle. The
mesh error is below 1 %. `studies.membrane`, with other elements and another mesh, computes the
stiffnesses in the middle to within 0.5 %.
"""

import numpy as np

#: Force over depth by pressure (17.2, 34.5, 51.7 kPa) and cylinder [N/m].
STIFFNESS = np.array(
    [[1746.0, 2023.0, 2259.0], [2465.0, 2783.0, 3024.0], [2945.0, 3270.0, 3504.0]]
)
#: Force over depth by cylinder, 12.7 cm from an end, at 34.5 kPa [N/m].
STIFFNESS_NEAR_END = np.array([4026.0, 4758.0, 5409.0])
#: Length of contact by cylinder, at 34.5 kPa [m].
CONTACT = (0.011, 0.030, 0.045)
#: Smallest and largest volume that a cylinder displaces in the tube, and volume of the tube [m^3].
DISPLACED, VOLUME = (1.6e-6, 1.9e-6), 6226e-6
#: Ambient pressure [Pa] (ISO 2533).
ATMOSPHERE = 101_325.0
