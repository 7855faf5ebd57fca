import time
import ev3dev2_glue as glue

news = None
while news is None:
    asked = len(glue.pyState()["messages"])
    print("PY::What does it see?")
    while len(glue.pyState()["messages"]) == asked:
        time.sleep(0.5)
    news = glue.pyState()["messages"][-1]["news"]
say(news)
