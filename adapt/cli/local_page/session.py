"""Session of the page: its folder, files, motions, runs and results."""

import asyncio
import os
import secrets
import shutil
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from adapt.cli.local_page.child_runs import Children, Ended
from adapt.cli.local_page.marker_names import mapping_toml, pointing_here
from adapt.cli.local_page.uploads import State, Upload, accepted, with_own_names
from adapt.cli.local_page.zipped_folder import zip_folder
from motions import InputError, Motions, read_motions
from motions.errors import InputWarning
from motions.formats.marker_files.any_markers import read_markers

COMMANDS = ("adapt", "diagnose")
"""Commands that the page runs, in this order; each writes into the folder of its name."""

MAPPING = "map.toml"
ZIP = "girdle.zip"


@dataclass
class LaboratoryOptions:
    """Options on the page for all files of marker positions."""

    markers: dict[str, str]
    unit: str = ""
    aa_to_ac: str = ""
    sc_from_ij: str = ""


class Session:
    """One open page. All its files are in a folder of its own, which is removed with the session."""

    def __init__(self, root: Path) -> None:
        """Make the folder, with an unguessable name, inside ``root``."""
        self.token = secrets.token_urlsafe(16)
        self.folder = root / f"session-{self.token}"
        for name in ("uploads", "motions"):
            (self.folder / name).mkdir(parents=True)
        self.files: list[Upload] = []
        self.options = LaboratoryOptions({})
        self.motions: Motions | None = None
        self.children = Children(self.folder)

    def close(self) -> None:
        """End running commands and remove the folder."""
        self.children.cancel()
        shutil.rmtree(self.folder, ignore_errors=True)

    def place(self, client_name: str, size: int) -> Upload:
        """Register a file, whose content belongs at ``folder / source``; raise an InputError if the file is refused."""
        upload = accepted(client_name, size, self.files)
        self.files.append(upload)
        return upload

    def look_at(self, upload: Upload) -> None:
        """Read the marker names of a file of marker positions; its errors are reported by the conversion."""
        try:
            with warnings.catch_warnings(action="ignore", category=InputWarning):
                markers = read_markers(self.folder / upload.source)
        except InputError:
            return
        upload.markers = tuple(dict.fromkeys(markers.names)) if markers else ()

    def remove(self, upload: Upload) -> None:
        """Remove a file and its motion file."""
        self.files.remove(upload)
        for place in (upload.source, upload.motions):
            (self.folder / place).unlink(missing_ok=True)

    @property
    def marker_names(self) -> list[str]:
        """Names of the markers of all files, each once."""
        return list(dict.fromkeys(name for one in self.files for name in one.markers))

    @property
    def waiting(self) -> bool:
        """True where a file waits to be read."""
        return any(one.state is State.WAITING for one in self.files)

    @property
    def altered(self) -> bool:
        """True where labels or options were altered since a file was read."""
        return any(one.state is State.ALTERED for one in self.files)

    async def convert_waiting(self) -> None:
        """Convert every waiting file to a motion file."""
        text = mapping_toml(self.options.markers, self.options.unit)
        (self.folder / MAPPING).write_text(text, encoding="utf-8")
        free = asyncio.Semaphore(os.cpu_count() or 1)

        async def one_of_them(upload: Upload) -> None:
            async with free:
                await self._convert(upload)

        await asyncio.gather(*(one_of_them(one) for one in self.files if one.state is State.WAITING))

    async def _convert(self, upload: Upload) -> None:
        upload.state = State.READING
        (self.folder / upload.motions).unlink(missing_ok=True)
        ended = await self.children.girdle(convert_arguments(upload, self.options))
        said = ended.message if not ended.useful or ended.said else ended.out.partition(" in motions/")[0].strip()
        said = said.removeprefix("error: ")
        upload.said = self.named(pointing_here(said) if upload.markers else said)
        if upload.state is State.READING:  # else it was altered during the conversion
            upload.state = State.READ if ended.useful else State.REFUSED

    async def read(self) -> None:
        """Read all motion files together; raise an InputError if no subject in them can be used."""
        self.motions = None
        paths = [self.folder / one.motions for one in self.files if one.read]
        if paths:
            self.motions = await asyncio.to_thread(_read, *paths)

    def named(self, text: str) -> str:
        """Replace the stored names of files in a message by the names in the browser."""
        return with_own_names(text.replace(f"{self.folder}{os.sep}", ""), self.files)

    async def run(self, command: str, models: Sequence[str], own_bones: bool, progress: Callable[[str], None]) -> Ended:
        """Run ``girdle adapt`` or ``girdle diagnose`` on the motions that were read.

        ``own_bones`` is for ``girdle adapt``; ``girdle diagnose`` always includes own bones.
        """
        shutil.rmtree(self.folder / command, ignore_errors=True)
        files = [one.motions for one in self.files if one.read]
        chosen = [f"--model={name}" for name in models]
        if own_bones and command == "adapt":
            chosen.append("--own-bones")
        ended = await self.children.girdle([command, *files, *chosen, f"--out={command}"], progress)
        if not ended.useful:
            shutil.rmtree(self.folder / command, ignore_errors=True)
        return ended

    def clear_results(self) -> None:
        """Remove the results of earlier runs, which do not belong to the present files."""
        for name in COMMANDS:
            shutil.rmtree(self.folder / name, ignore_errors=True)

    def report(self, command: str) -> Path | None:
        """Return the report of a command, if there is one."""
        path = self.folder / command / "report.html"
        return path if command in COMMANDS and path.is_file() else None

    def zipped(self) -> Path:
        """Put all files of the session into one zip."""
        target = self.folder / ZIP
        zip_folder(self.folder, ("uploads", "motions", MAPPING, *COMMANDS), self.files, target)
        return target


def _read(*paths: Path) -> Motions:
    """Read motion files without warnings, which were given when each file was converted."""
    with warnings.catch_warnings(action="ignore", category=InputWarning):
        return read_motions(*paths)


def convert_arguments(upload: Upload, options: LaboratoryOptions) -> list[str]:
    """Write the arguments of ``girdle convert`` from the labels of a file and the options on the page."""
    arguments = ["convert", upload.source, upload.motions]
    if upload.names_itself:
        return arguments
    labels = upload.labels
    said = {"subject": labels.subject, "motion": labels.motion, "side": labels.side}
    if upload.markers:
        said |= {"at": labels.at, "map": MAPPING, "aa-to-ac": options.aa_to_ac, "sc-from-ij": options.sc_from_ij}
    return [*arguments, *(f"--{name}={value}" for name, value in said.items() if value)]
