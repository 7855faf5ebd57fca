"""RoboLab in a Jupyter notebook: run, watch and check robot programs where students write them."""
