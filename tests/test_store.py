"""Runs that are computed once: side by side where several are missing, in the process itself where it is one."""

from concurrent.futures import ThreadPoolExecutor
from threading import current_thread, main_thread

from repro.scene import load_scene
from verification import store


def test_several_missing_runs_are_made_side_by_side_and_one_in_the_process(tmp_path, monkeypatch):
    """Each once, and none that is there."""
    made, runs = [], store.Folders(tmp_path)

    def run(scene, folder):
        made.append((scene.pore.width, current_thread() is main_thread()))
        folder.mkdir()
        (folder / "run.json").write_text("{}")

    monkeypatch.setattr(store, "run", run)
    monkeypatch.setattr(store, "ProcessPoolExecutor", ThreadPoolExecutor)
    one, all_three = (50.0, True), [(40.0, False), (50.0, True), (60.0, False)]
    for widths, known in (([50], [one]), ([40, 50, 50, 60], all_three), ([60, 40], all_three)):
        scenes = [load_scene("flow_only", [f"pore.width={width} um"]) for width in widths]
        assert runs.get_all(scenes) == [*map(runs.path, scenes)]
        assert sorted(made) == known
