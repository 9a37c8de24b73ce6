"""matplotlib for the scripts that draw curves: Debian's own, installed where it is missing."""
import os
import subprocess


def plotter():
    try:
        import matplotlib
    except ImportError:
        as_root = [] if os.geteuid() == 0 else ["sudo"]
        subprocess.run([*as_root, "apt-get", "install", "-q", "-y", "--no-install-recommends", "python3-matplotlib"],
                       check=True)
        import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot
    return matplotlib.pyplot


def save(plt, figure, folder, name):
    path = os.path.join(folder, f"{name}.png")
    figure.savefig(path, dpi=110, metadata={"Software": None})
    plt.close(figure)
    print(path)
