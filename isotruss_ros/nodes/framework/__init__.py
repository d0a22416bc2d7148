"""What all nodes share: life cycle, parameters, subscriptions, diagnostics."""
