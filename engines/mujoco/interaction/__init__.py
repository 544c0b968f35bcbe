"""Contacts of the arms of the running model: power bonds, rigid contacts, objects in jaws."""
