"""Preambles that the notebook magics add before a program, so that it can use motors and sensors without imports."""

IMPORTS = """\
from ev3dev2.motor import MoveTank, MoveSteering, SpeedPercent, OUTPUT_B, OUTPUT_C
from ev3dev2.sensor import INPUT_1, INPUT_2, INPUT_3, INPUT_4
from ev3dev2.sensor.lego import ColorSensor, GyroSensor, UltrasonicSensor
from ev3dev2.sound import Sound
from ev3dev2_glue import get_clock
"""

PRELOADED = (
    IMPORTS
    + """
speaker = Sound()

def say(txt, wait=False, show=True):
    if show:
        print(txt)
    speaker.speak(txt, play_type=Sound.PLAY_WAIT_FOR_COMPLETE if wait else Sound.PLAY_NO_WAIT_FOR_COMPLETE)

tank_turn = MoveSteering(OUTPUT_B, OUTPUT_C)
tank_drive = MoveTank(OUTPUT_B, OUTPUT_C)
ultrasonic = UltrasonicSensor(INPUT_1)
colorLeft = ColorSensor(INPUT_2)
colorRight = ColorSensor(INPUT_3)
gyro = GyroSensor(INPUT_4)
"""
)

PREAMBLES = {"none": "", "imports": IMPORTS, "preloaded": PRELOADED}
