import time

# Drive, and print("IMG_DATA") again and again.
