"""What the arms of the running model touch: power bonds, rigid contacts, objects in jaws."""
