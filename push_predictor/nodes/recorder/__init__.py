"""Parts of the node push_recorder: parameters, subscriptions, status."""
