"""Whether files are the ones that somebody approved: hashes, and signatures over them."""
