import time

for kind in ("PY", "JSON", "TEXT", "DATA") * 5:
    print("PY::{'test_key':'test value', 'kind': '" + kind + "'}")
    print("IMG_DATA")
time.sleep(1)
