"""Let Palpate find the cause, and plot the error patterns."""

import palpate as pp

if __name__ == "__main__":
    result = pp.diagnose("my-block", out="runs/one")
    print(result.verdict)
    for cause in result.causes:
        print(cause["effect"], cause["parameters"])
    result.plot_patterns("patterns.png")
