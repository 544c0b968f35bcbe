"""Sessions and hubs on other machines, and the process that holds a device for them."""
