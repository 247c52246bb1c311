"""Runs that are computed once: side by side where several are missing, in the process itself where it is one."""

from concurrent.futures import ThreadPoolExecutor
from threading import current_thread, main_thread

from repro.run import cache
from repro.scene import load_scene


def test_several_missing_runs_are_made_side_by_side_and_one_in_the_process(tmp_path, monkeypatch):
    """Each once, and none that is there."""
    made = []

    def run(scene, folder):
        made.append((scene.pore.width, current_thread() is main_thread()))
        folder.mkdir()
        (folder / "run.json").write_text("{}")

    monkeypatch.setattr(cache, "run", run)
    monkeypatch.setattr(cache, "ProcessPoolExecutor", ThreadPoolExecutor)
    one, all_three = (50.0, True), [(40.0, False), (50.0, True), (60.0, False)]
    for widths, known in (([50], [one]), ([40, 50, 50, 60], all_three), ([60, 40], all_three)):
        scenes = [load_scene("flow_only", [f"pore.width={width} um"]) for width in widths]
        assert cache.cached_runs(scenes, tmp_path) == [cache.run_folder(scene, tmp_path) for scene in scenes]
        assert sorted(made) == known
