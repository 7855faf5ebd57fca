# The alphabet and the digits, in any order.
for letter in "TMTM129129MT":
    for digit in "129":
        say(letter)
        say(digit)
for word in ("T", "M", "1", "2", "9") * 4:
    say(word)
