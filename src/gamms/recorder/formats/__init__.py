"""The formats of recordings, one file each; each file says how its bytes are laid out."""
