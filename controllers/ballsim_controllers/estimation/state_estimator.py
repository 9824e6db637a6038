"""stub"""
from ballsim_controllers.whole_body.nominal_stance import solve_nominal_stance
class StateEstimator:
    def __init__(self, robot, ball, dt):
        self.stance = solve_nominal_stance(robot, ball.radius)
        self.nominal_com_height = self.stance.com_height
