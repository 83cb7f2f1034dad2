"""The live view: a page, served on this machine, that shows what vessels see and decide."""
