"""What a joint like the gripper may do, as the tests of motions and references share it."""

from bristle.identification.limits import Limits

LIMITS = Limits(
    position=(-0.5, 1.5), slowest=0.02, velocity=1.2, acceleration=15.0, torque=0.06, time=None, hold=3.0,
    frequency=8.0, rate=100.0,
)  # fmt: skip  # a list of values
