# Quicker the farther the leader is away; at 22 cm as quickly as it drove then.
while True:
    speed = (ultrasonic.distance_centimeters - 18) * 2.5
    speed = max(-30, min(speed, 50))
    tank_drive.on(SpeedPercent(speed), SpeedPercent(speed))
