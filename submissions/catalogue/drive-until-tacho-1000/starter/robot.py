%%sim_magic_preloaded -b Empty_Map
"""Drive until the left wheel's position has reached 1000 degrees."""
import time

tank_drive.on(SpeedPercent(50), SpeedPercent(50))

# TODO: wait in a loop while the position is below 1000.

tank_drive.off()
