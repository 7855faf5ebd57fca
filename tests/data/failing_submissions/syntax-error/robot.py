for i in range(5)
    print("PY::" + str(i))
