%%sim_magic_preloaded
# A speech synthesiser reads separate letters as letters.
say("T M 1 2 9", wait=True)
