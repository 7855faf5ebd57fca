%%sim_magic_preloaded
# range() stops before its second number: 5 and 100 are never said.
for count in range(1, 5):
    say(str(count))

for count in range(10, 100, 10):
    say(str(count))
