# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A simulated robot with reset and step, for reinforcement learning."""

from isotruss_ros import core
import numpy as np

PERIOD, MEMBERS = 0.05, ('north/P-Z', 'north/Z-R')  # [s]


class CarryingTask:
    """Move a held disc to a goal: the action is a twist, the reward minus the distance [m]."""

    def reset(self, seed: int) -> np.ndarray:
        """Reset the grip of the disc, with up to 2 % of slip of the rollers; choose a goal."""
        self.random = np.random.default_rng(seed)
        home = core.load_robot('nine_member').home
        self.grip = core.place_between(home, MEMBERS, core.Disc(0.3), indentation=0.01)
        faults = core.RollerFaults(slip=self.random.uniform(0.0, 0.02))
        self.disc = core.ElasticObject(self.grip.body, friction=0.8)
        self.robot = core.SimulatedRobot(home, self.disc, faults, seed)
        self.robot.advance(0.0)  # the members close on the disc
        self.goal = self.observe()[:2] + self.random.uniform(-0.02, 0.02, 2)
        return self.observe()

    def observe(self) -> np.ndarray:
        """Return the pose of the disc, (x, y, angle) [m, m, rad]."""
        pose = self.robot.object_pose
        return np.array([pose.x, pose.y, pose.angle])

    def step(self, twist: np.ndarray) -> tuple[np.ndarray, float, bool]:
        """Simulate one period; return observation, reward and whether the disc is lost."""
        body = self.grip.body.moved_to(self.robot.object_pose)
        grip = core.Grip(MEMBERS, body, 0.8)
        command = core.solve_twist(self.robot.config, grip, twist)
        self.robot.command(command.roller_velocities)
        self.robot.advance(PERIOD)
        pose = self.observe()
        return pose, -float(np.hypot(*(self.goal - pose[:2]))), self.disc.grasp is None


task = CarryingTask()
for name, gain in (('random', 0.0), ('towards the goal', 1.0)):
    rewards = []
    for episode in range(3):
        observation, lost, reward = task.reset(episode), False, 0.0
        for _ in range(60):
            way = task.goal - observation[:2]
            twist = np.append(gain * way, 0.0) if gain else task.random.uniform(-0.02, 0.02, 3)
            observation, reward, lost = task.step(twist)
            if lost:
                break
        rewards.append(reward)
    print(f'{name}: {1000.0 * -np.mean(rewards):.1f} mm from the goal at the end')
