"""The robot in MuJoCo: any robot file as a model, and a plant that rollers drive."""
