"""Move the object with a roller that does not work, and list the motions that are left."""

from isotruss_ros import core

home = core.load_robot('nine_member').home
grasp = core.Grasp('north/Z', core.tangent_center(home, 'north/Z', 0.3), 0.3)
twist = (0.0, 0.02, 0.0)

south_and_east = ('south/P', 'south/Q', 'east/Q', 'east/R')
for failed in ((), ('east/R',), south_and_east):
    command = core.solve_twist(home, grasp, twist, failed=failed)
    left = core.reachable_twists(home, grasp, failed=failed)
    print(f'failed: {", ".join(failed) or "none"}: {len(left)} independent motions left')
    print('  ', command.status, command.achieved_twist)
