import time

# Send the dictionary, wait, send the image, wait.
time.sleep(1)
