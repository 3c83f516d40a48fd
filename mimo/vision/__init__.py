"""From pictures to h: frames under the resting policy, the encoder, and how good it is."""
