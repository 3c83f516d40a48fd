"""From actions to transitions to rewards to Q values: a run of the experiment."""
