"""What a policy sees and does, in numbers: layouts of state and action, and the contract that names them."""
