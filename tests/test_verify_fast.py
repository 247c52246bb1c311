"""`make verify-fast` as a part of `make test`: every quick case of every stage, in processes of their own."""
import subprocess
import sys


def test_every_quick_case_passes():
    """Exit status 0, else the message tells what fell short; the report, which is of a whole run, is not written."""
    done = subprocess.run([sys.executable, "-m", "verification", "--fast"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "report:" not in done.stdout and " cases pass; " in done.stdout
