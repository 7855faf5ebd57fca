%%sim_magic_preloaded --background Simple_Shapes --output --array --hide --world --autorun
print("Hello from my own cell")
