"""Many runs of one scene, whose parameters, initial states and inputs differ."""
