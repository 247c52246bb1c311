"""Runs that are computed once: side by side where several are missing, in the process itself where it is one."""

from contextlib import ExitStack

from repro.run import cache
from repro.scene import load_scene


def test_several_missing_runs_are_made_side_by_side_and_one_in_the_process(tmp_path, monkeypatch):
    """Each once, and none that is there."""
    made, beside = [], []

    def run(scene, folder):
        made.append(scene.pore.width)
        folder.mkdir()
        (folder / "run.json").write_text("{}")

    class Pool(ExitStack):
        def __init__(self, max_workers):
            super().__init__()

        def map(self, function, scenes, folders):
            beside.extend(scene.pore.width for scene in scenes)
            return map(function, scenes, folders)

    monkeypatch.setattr(cache, "run", run)
    monkeypatch.setattr(cache, "ProcessPoolExecutor", Pool)
    for widths, now_made, now_beside in (([50], [50], []), ([40, 50, 50, 60], [50, 40, 60], [40, 60]),
                                         ([60, 40], [50, 40, 60], [40, 60])):
        scenes = [load_scene("flow_only", [f"pore.width={width} um"]) for width in widths]
        assert cache.cached_runs(scenes, tmp_path) == [cache.run_folder(scene, tmp_path) for scene in scenes]
        assert (made, beside) == (now_made, now_beside)
