"""Fig. 6: interference stiffness of a tube over the position of a cylinder pressed into it."""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.power_law import Law, PowerLaw
from isotruss_ros.core.tube_stiffness import TubeStiffness
from isotruss_ros.fit.measurements import MODES
from isotruss_ros.paper.clamped_tube import DEPTH, press, Pressed
from isotruss_ros.paper.default_tube import default_tube, end_stiffnesses
from isotruss_ros.paper.figure_6_drawing import draw
from isotruss_ros.paper.item import Advance, Item, Report
from isotruss_ros.paper.parameters import CYLINDERS, DISCS, PRESSURE, TUBE_DIAMETER, TUBE_LENGTH
from isotruss_ros.paper.tables import number, Table
from isotruss_ros.paper.wrinkling import wrinkling_moment
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Positions along the tube, and depths at its middle [m].
POSITIONS = np.linspace(1.0 / 6.0, 5.0 / 6.0, 33) * TUBE_LENGTH
DEPTHS = np.linspace(0.0, 0.030, 13)[1:]
MIDDLE = 0.5 * TUBE_LENGTH


@dataclass(frozen=True)
class Interference:
    """
    What Fig. 6 shows; first axis of the arrays: the three cylinders.

    :ivar positions: along the tube [m].
    :ivar depths: at the middle [m].
    :ivar stiffness: (3, positions) without gas, at DEPTH [N/m].
    :ivar gain: (3, depths) that the gas adds at the middle, as a share, default theory.
    :ivar proportional: the same for a tube whose stiffness goes as the pressure.
    :ivar middle: at the middle, at DEPTH, without and with gas, default theory.
    :ivar pinned: stiffness at the middle with ends that turn freely [N/m].
    :ivar wrinkling: depth at which the tube begins to wrinkle, pressed at its middle [m].
    """

    positions: Array
    depths: Array
    stiffness: Array
    gain: Array
    proportional: Array
    middle: tuple[tuple[Pressed, Pressed], ...]
    pinned: float
    wrinkling: float


def compute(advance: Advance) -> Interference:
    """Return stiffnesses for all cylinders."""
    tube, law = default_tube(), proportional_tube()
    stiffness, gain, proportional, middle = [], [], [], []
    for disc in DISCS:
        stiffness.append([press(tube, float(x), disc, DEPTH).stiffness for x in POSITIONS])
        advance((len(middle) + 0.5) / len(DISCS))
        gain.append([gas_gain(tube, disc, float(depth)) for depth in DEPTHS])
        proportional.append([gas_gain(law, disc, float(depth)) for depth in DEPTHS])
        plain, gas = (press(tube, MIDDLE, disc, DEPTH, gas) for gas in (False, True))
        middle.append((plain, gas))
        advance(len(middle) / len(DISCS))
    soft = middle[0][0].stiffness
    # At the middle of a clamped beam and at its ends M = F L / 8, shear or not.
    force = 8.0 * wrinkling_moment(PRESSURE, 0.5 * TUBE_DIAMETER) / TUBE_LENGTH
    return Interference(
        POSITIONS,
        DEPTHS,
        np.array(stiffness),
        np.array(gain),
        np.array(proportional),
        tuple(middle),
        press(tube, MIDDLE, DISCS[0], DEPTH, pinned=True).stiffness,
        force / soft,
    )


def proportional_tube() -> TubeStiffness:
    """Return a tube that is as stiff as the default one, all of it by pressure: k ~ p."""
    stiffnesses = end_stiffnesses(PRESSURE, TUBE_LENGTH)
    return PowerLaw(*(Law(float(stiffnesses[mode]) / PRESSURE, 1.0, 0.0) for mode in MODES))


def gas_gain(tube: TubeStiffness, disc: float, depth: float) -> float:
    """Return by which share the gas raises the stiffness at the middle."""
    plain, gas = (press(tube, MIDDLE, disc, depth, gas) for gas in (False, True))
    return gas.stiffness / plain.stiffness - 1.0


def spread(stiffness: Array) -> Array:
    """Return by which share the stiffest cylinder is above the softest, at each position."""
    return stiffness.max(axis=0) / stiffness.min(axis=0) - 1.0


def report(result: Interference) -> Report:
    """Return the stiffnesses with and without gas."""
    differ = 100.0 * spread(result.stiffness)
    at = int(np.searchsorted(DEPTHS, DEPTH - 1e-9))
    small, large = result.proportional[0, at], result.proportional[-1, at]
    deep_small, deep_large = result.proportional[0, -1], result.proportional[-1, -1]
    soft = result.middle[0][0].stiffness
    return Report(
        heading='Fig. 6: interference stiffness',
        picture='Left, stiffness over the position of the cylinder for three cylinders, whose '
        'curves are one; right, what the gas adds over the depth, more for larger cylinders',
        stated='Cylinders of 2.54, 10.2 and 20.3 cm were pressed into a tube (10.2 cm, 76.2 cm '
        'long, 34.5 kPa) at several positions. The model, with discs of 12.7, 20.3 and 30.5 cm '
        'on the centre line, is good for small cylinders and does not see the diameter, while '
        'measured stiffness grows with it: the gas, which the model leaves out, is compressed.',
        computed=f'Without gas the three curves are one: they differ by {number(differ.min(), 2)} '
        f'% at the middle and by {number(differ.max(), 2)} % at a sixth of the length, where '
        'the larger disc is touched over a longer piece. With gas the stiffness grows with the '
        f"cylinder. Where all of it is the pressure's (k ~ p), {1e3 * DEPTH:g} mm deep, the "
        f'gas adds {number(100 * small, 2)} to {number(100 * large, 2)} %, and '
        f'{number(100 * deep_small, 2)} to {number(100 * deep_large, 2)} % at '
        f'{1e3 * DEPTHS[-1]:g} mm; with the default theory, in which the fabric carries most, '
        'about a tenth of that.',
        difference='Insensitive without gas, growing with it: as the paper has it. How large the '
        'measured growth is, the text does not say; if it is more than that, compression of the '
        'gas alone does not explain it here. The model bends the tube and leaves its '
        'cross-section round, while a real tube is also flattened at the contact, over an area '
        'that grows with the cylinder.',
        assumption='Ends clamped, as by guide rings; the text does not say. With ends free to '
        f'turn the middle has {number(result.pinned, 2)} instead of {number(soft, 2)} N/m. '
        f'Stiffness is force over depth at {1e3 * DEPTH:g} mm, before the tube wrinkles '
        f'({number(1e3 * result.wrinkling, 2)} mm at the middle, M_w = π p r³/2). Gas: '
        '76.2 cm of tube, sealed, at constant temperature, lose the volume in which the '
        'cylinder and the undeformed tube overlap, an upper bound; a longer sealed tube '
        'gains less, in proportion.',
        tables=(_middle(result), _positions(result)),
    )


def _middle(result: Interference) -> Table:
    at = int(np.searchsorted(DEPTHS, DEPTH - 1e-9))
    rows = [
        (
            f'{number(100 * cylinder)} ({number(100 * disc)})',
            number(plain.stiffness, 4),
            number(gas.stiffness, 4),
            number(1e2 * result.gain[i, at], 2),
            number(1e2 * result.proportional[i, at]),
            number(1e-3 * gas.pressure, 4),
            number(1e3 * plain.contact),
        )
        for i, (cylinder, disc, (plain, gas)) in enumerate(
            zip(CYLINDERS, DISCS, result.middle, strict=True)
        )
    ]
    headings = (
        'cylinder (disc) [cm]',
        'without gas [N/m]',
        'with gas [N/m]',
        'gain [%]',
        'gain if k ~ p [%]',
        'pressure with gas [kPa]',
        'contact [mm]',
    )
    return Table('figure_6', f'At the middle, {1e3 * DEPTH:g} mm deep', headings, rows)


def _positions(result: Interference) -> Table:
    chosen = range(0, len(POSITIONS) // 2 + 1, 4)
    rows = [
        (
            number(100 * POSITIONS[i]),
            *(number(k, 4) for k in result.stiffness[:, i]),
            number(100 * spread(result.stiffness)[i], 2),
        )
        for i in chosen
    ]
    headings = (
        'position [cm]',
        *(f'{number(100 * cylinder)} cm [N/m]' for cylinder in CYLINDERS),
        'spread [%]',
    )
    caption = f'Without gas, {1e3 * DEPTH:g} mm deep; the other half is its mirror image'
    return Table('figure_6_positions', caption, headings, rows)


ITEM = Item('figure_6', compute, report, draw)
