"""Runs that are computed once: in parallel if several are missing, in the process itself if one is."""

from concurrent.futures import ThreadPoolExecutor
from threading import current_thread, main_thread

from repro.scene import load_scene
from verification import store


def test_missing_runs_are_computed_in_parallel_and_one_in_the_process(tmp_path, monkeypatch):
    """Each missing run is computed once, and no existing one."""
    computed, runs = [], store.Folders(tmp_path)

    def run(scene, folder):
        computed.append((scene.pore.width, current_thread() is main_thread()))
        folder.mkdir()
        (folder / "run.json").write_text("{}")

    monkeypatch.setattr(store, "run", run)
    monkeypatch.setattr(store, "ProcessPoolExecutor", ThreadPoolExecutor)
    one_run, all_three = (50.0, True), [(40.0, False), (50.0, True), (60.0, False)]
    for widths, expected in (([50], [one_run]), ([40, 50, 50, 60], all_three), ([60, 40], all_three)):
        scenes = [load_scene("flow_only", [f"pore.width={width} um"]) for width in widths]
        assert runs.get_all(scenes) == [*map(runs.path, scenes)]
        assert sorted(computed) == expected
