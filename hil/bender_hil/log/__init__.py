"""The log of a run: lines of JSON that survive a kill, the record made from them, the replay that checks them."""
