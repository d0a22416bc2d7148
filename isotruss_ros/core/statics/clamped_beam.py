# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A beam with clamped ends at one place: shape functions, and how it gives there, in closed form.

A Timoshenko beam between its ends deforms as a cantilever from the start whose far end is brought
to where it is held; what a load does to the tip of the cantilever follows by reciprocity. Numbers
of Python: for the few places at which an object is held they are several times quicker than arrays
of NumPy.
"""

from __future__ import annotations

#: Numbers that `ClampedBeam.at` returns.
VALUES = 30


class ClampedBeam:
    """
    One piece of a member between its clamped ends, the start of which may turn freely.

    :param length: [m].
    :param axial: EA [N].
    :param flexural: EI [N m^2].
    :param shear: GA [N].
    :param pinned: whether the start transmits no moment.
    :param sense: +1 where the piece runs along its member, -1 where it runs backward.
    :param softness: its compliance against that of the model.
    """

    def __init__(
        self,
        length: float,
        axial: float,
        flexural: float,
        shear: float,
        pinned: bool,
        sense: float,
        softness: float,
    ) -> None:
        ei, ga = 1.0 / flexural, 1.0 / shear
        # Deflection and rotation of the tip by force and moment there, and the inverse of that.
        sink, cross, turn = length**3 * ei / 3.0 + length * ga, 0.5 * length**2 * ei, length * ei
        scale = 1.0 / (sink * turn - cross * cross)
        p, q, r = scale * turn, -scale * cross, scale * sink
        # Force and moment at the tip by deflection and rotation of the start, then of the end.
        force, moment = [-p, -length * p - q, p, q], [-q, -length * q - r, q, r]
        pin = [-length * f - m for f, m in zip(force, moment, strict=True)]
        self._start, self._soft = (force[1], moment[1]), 0.0
        self._free = [0.0] * 4
        if pinned:
            # The rotation of a pinned start follows from no moment there.
            self._free = [value / pin[1] for value in pin]
            self._soft = 1.0 / pin[1]
            force, moment = (
                [value - row[1] * free for value, free in zip(row, self._free, strict=True)]
                for row in (force, moment)
            )
        self._force, self._moment = force, moment
        self._shear = [ga * value for value in force]
        self._tip = p, q, r
        self._length, self._sense, self._softness = length, sense, softness
        self._ei, self._ga, self._axial = ei, ga, softness / (axial * length)

    def at(self, x: float) -> list[float]:
        """
        Return what the member does at a place, along and across it; all derivatives by the place.

        :param x: from the start of the piece [m].
        :return: the displacement along by those of both ends; by deflection and rotation of the
            start and of the end the displacement across, the slope of the line and the rotation of
            the section; derivatives of the displacement along and of the slope; then, by loads
            there, ends held: displacement along by the force along; displacement across and mean
            slope of both sides by force across and moment; and the derivatives of these five.
        """
        length, ei, ga, sense = self._length, self._ei, self._ga, self._sense
        # By force and moment at the tip of the cantilever: deflection, slope, rotation, bending.
        bow, bend = x * ei, (length - x) * ei
        turn = 0.5 * (length + (length - x)) * bow
        sink, sag = x * (x * (2.0 * length + (length - x)) * ei / 6.0 + ga), 0.5 * x * bow
        tilt = turn + ga
        force, moment, free = self._force, self._moment, self._free
        f0, f1, f2, f3 = force
        m0, m1, m2, m3 = moment
        z0, z1, z2, z3 = free
        w0 = sink * f0 + sag * m0 + 1.0 - x * z0
        w1 = sink * f1 + sag * m1 + x * (1.0 - z1)
        w2 = sink * f2 + sag * m2 - x * z2
        w3 = sink * f3 + sag * m3 - x * z3
        s0 = tilt * f0 + bow * m0 - z0
        s1 = tilt * f1 + bow * m1 + 1.0 - z1
        s2 = tilt * f2 + bow * m2 - z2
        s3 = tilt * f3 + bow * m3 - z3
        g0, g1, g2, g3 = self._shear
        # By loads at the place, less what holds the tip, and more where the start turns freely.
        p, q, r = self._tip
        first, second = sink * p + sag * q, sink * q + sag * r
        third, fourth = tilt * p + bow * q, tilt * q + bow * r
        i00 = x * (x * bow / 3.0 + ga) - first * sink - second * sag
        i01 = sag - first * turn - second * bow
        i10 = sag + 0.5 * ga - third * sink - fourth * sag
        i11 = bow - third * turn - fourth * bow
        j00 = x * bow + ga - 2.0 * (first * tilt + second * bow)
        j01 = bow - third * turn - fourth * bow - first * bend - second * ei
        j10 = bow - first * bend - second * ei - third * tilt - fourth * bow
        pull, push = bend * p + ei * q, bend * q + ei * r
        j11 = ei - pull * turn - push * bow - third * bend - fourth * ei
        soft = self._soft
        if soft:
            force_there, moment_there = self._start
            moved = sink * force_there + sag * moment_there + x
            sloped = tilt * force_there + bow * moment_there + 1.0
            turned = sloped - ga * force_there
            bent = bend * force_there + ei * moment_there
            i00 += soft * moved * moved
            i01 += soft * moved * turned
            i10 += soft * sloped * moved
            i11 += soft * sloped * turned
            j00 += 2.0 * soft * moved * sloped
            j01 += soft * (sloped * turned + moved * bent)
            j10 += soft * (bent * moved + sloped * sloped)
            j11 += soft * bent * (turned + sloped)
        part, scale, stretch = x / length, self._softness, self._axial
        both = sense * scale
        return [
            sense * (1.0 - part),
            sense * part,
            sense * w0,
            sense * w1,
            sense * w2,
            sense * w3,
            s0,
            s1,
            s2,
            s3,
            s0 - g0,
            s1 - g1,
            s2 - g2,
            s3 - g3,
            -1.0 / length,
            1.0 / length,
            sense * (bend * f0 + ei * m0),
            sense * (bend * f1 + ei * m1),
            sense * (bend * f2 + ei * m2),
            sense * (bend * f3 + ei * m3),
            stretch * x * (length - x),
            scale * i00,
            both * i01,
            both * i10,
            scale * i11,
            sense * stretch * (length - 2.0 * x),
            both * j00,
            scale * j01,
            scale * j10,
            both * j11,
        ]
