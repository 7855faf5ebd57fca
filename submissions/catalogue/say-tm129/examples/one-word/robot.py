%%sim_magic_preloaded
say("Hello, this is TM129")
