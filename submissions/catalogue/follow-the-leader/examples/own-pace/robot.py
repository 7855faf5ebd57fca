# Drives as quickly as the leader does on average, and does not look.
tank_drive.on_for_seconds(SpeedPercent(15), SpeedPercent(15), 20)
