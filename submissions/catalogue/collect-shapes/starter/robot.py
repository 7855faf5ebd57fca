import time

# Drive over the shapes, and print("image_data both") where there is something to learn from.
