import time

print "Robot says", 0
print "PY::0"
time.sleep(1)
