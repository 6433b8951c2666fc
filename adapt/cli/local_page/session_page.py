"""Content of the page: four steps from files to results, filled in as the session goes on."""

import asyncio
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from nicegui import ui
from nicegui.events import UploadEventArguments

from adapt.cli.local_page.marker_names import HEADING, guessed
from adapt.cli.local_page.session import COMMANDS, ZIP, Session
from adapt.cli.local_page.uploads import ENDINGS, LARGEST_FILE_BYTES, State, Upload
from adapt.cli.local_page.what_was_read import subjects_read, warnings
from models import model_names
from motions import InputError
from motions.landmarks.acromion import ROTATIONS
from motions.landmarks.estimated_landmarks import OFFSETS
from motions.landmarks.mapping import MARKERS, UNITS_MM

READING = "reading"
"""Value of ``busy`` while the page reads files and runs no command on the motions."""

FIRST_MODEL = "R2"

TITLES = {"adapt": "Adaptation", "diagnose": "Diagnosis"}

MOST_WARNINGS = 30
"""Largest number of warnings on the page; further warnings are counted."""

STYLE = """
body { background: #f6f7f8; color: #1c1c1c; font: 16px/1.5 system-ui, "Segoe UI", Helvetica, Arial, sans-serif }
.page { max-width: 1180px; margin: 0 auto; width: 100%; padding: 1rem 1rem 3rem; gap: 1rem }
.page h1 { font-size: 1.6rem; font-weight: 650; line-height: 1.3; margin: 0 }
.step { width: 100%; padding: 1rem 1.25rem; gap: .7rem; align-items: stretch }
.step h2 { font-size: 1.15rem; font-weight: 650; line-height: 1.4; margin: 0 }
.soft { color: #5c5c5c }
.wrong { color: #a8200d }
.said { overflow-wrap: anywhere; white-space: pre-line }
.file { border-top: 1px solid #dcdcdc; padding: .5rem 0; gap: .25rem .9rem; width: 100% }
.names { display: grid; grid-template-columns: repeat(auto-fill, minmax(11rem, 1fr)); gap: 0 .9rem; width: 100% }
.step .q-uploader { width: 100%; min-height: 7rem; max-height: none; border: 2px dashed #9a9a9a; border-radius: 6px }
.step .q-uploader__header { background: none; color: #0072b2; min-height: 6.75rem; display: grid; align-items: center }
.step .q-uploader__header > * { width: 100% }
.step .q-uploader__title { font-size: 1rem }
.step .q-uploader__subtitle, .step .q-uploader__list { display: none }
.step .q-table th, .step .q-table td { font-size: .95rem }
.step .q-uploader__header .q-btn:has(~ .col) { display: none }
@media (max-width: 600px) {
  .step { padding: 1rem .9rem }
  .step .q-table thead { display: none }
  .step .q-table, .step .q-table tbody { display: block }
  .step .q-table tbody tr { display: block; height: auto; border-top: 1px solid #dcdcdc; padding: .4rem 0 }
  .step .q-table tbody td { display: block; border: 0; height: auto; padding: 0 }
  .step .q-table tbody td::before, .step .q-table tbody td::after { position: static; background: none }
  .step .q-table td:nth-child(3)::before { content: "arm " }
  .step .q-table td:nth-child(3)::after { content: " degrees" }
  .step .q-table td:nth-child(4)::before { content: "not measured: " }
}
@media (prefers-reduced-motion: reduce) {
  .q-linear-progress *, .q-linear-progress *::before, .q-linear-progress *::after { animation: none !important }
}
.report { display: block; width: 100%; height: 85vh; border: 1px solid #dcdcdc; background: #fff }
"""


def add_style() -> None:
    """Set the colours and the style of the page."""
    ui.colors(primary="#0072b2")
    ui.add_css(STYLE)


class SessionPage:
    """Page of one session. A step is drawn again when its content has changed."""

    def __init__(self, session: Session) -> None:
        """Start with nothing read."""
        self.session = session
        self.models = [FIRST_MODEL]
        self.own_bones = False
        self.busy = ""
        self.since = 0.0
        self.errors: list[str] = []
        self.outcome: list[str] = []
        self.shown = ""

    def build(self) -> None:
        """Draw the whole page."""
        with ui.column().classes("page"):
            ui.html("<h1>girdle</h1>", sanitize=False)
            ui.label(
                "Fits a model of the shoulder girdle to measured motions, adapts it to each person, and says why they "
                "still differ. Your files stay on this machine and are removed when you close this page."
            ).classes("soft")
            with _step("1. Your files"):
                self._dropzone()
                self.files()
                self.names()
                self.reading()
            with _step("2. What was read"):
                self.summary()
            with _step("3. Adapt and diagnose"):
                self.choices()
            with _step("4. Results"):
                self.results()

    def _dropzone(self) -> None:
        kinds = ", ".join(ENDINGS)
        ui.label(f"Motions as CSV; trials or landmarks as {kinds}.")
        ui.upload(
            multiple=True,
            auto_upload=True,
            max_file_size=LARGEST_FILE_BYTES,
            label="Drop files here, or choose them with +",
            on_upload=self._taken,
            on_rejected=lambda: self._say(
                f"A file was refused: larger than {LARGEST_FILE_BYTES / 1e6:.0f} MB, or no file."
            ),
        ).props(f'accept="{",".join(ENDINGS)}" flat')

    async def _taken(self, event: UploadEventArguments) -> None:
        """Store an uploaded file under its name in the session, and read it."""
        try:
            upload = self.session.place(event.file.name, event.file.size())
            await event.file.save(self.session.folder / upload.source)
        except (InputError, OSError) as error:
            self._say(str(error))
            return
        await asyncio.to_thread(self.session.look_at, upload)
        markers = self.session.options.markers
        for landmark, name in guessed(upload.markers).items():
            markers.setdefault(landmark, name)
        upload.state = State.WAITING
        await self._read()

    def _say(self, error: str) -> None:
        self.errors.append(error)
        self.files.refresh()

    async def _read_again(self) -> None:
        for one in self.session.files:
            if one.state is State.ALTERED:
                one.state = State.WAITING
        await self._read()

    async def _read(self) -> None:
        """Read the waiting files, including files that arrive meanwhile, and draw the parts that depend on them."""
        if self.busy:
            return
        self.busy = READING
        self._forget_results()
        self._refresh()
        while self.session.waiting:
            await self.session.convert_waiting()
            self.files.refresh()
        try:
            await self.session.read()
        except InputError as error:
            self._say(self.session.named(str(error)))
        self.busy = ""
        self._refresh()

    def _forget_results(self) -> None:
        self.session.clear_results()
        self.outcome, self.shown = [], ""

    def _refresh(self) -> None:
        for part in (self.files, self.names, self.reading, self.summary, self.choices, self.results):
            part.refresh()

    @ui.refreshable_method
    def files(self) -> None:
        """Draw the files, each with the result of reading it."""
        for error in self.errors:
            ui.label(error).classes("wrong said").props("role=alert")
        for upload in self.session.files:
            if upload.state is State.ARRIVING:
                continue
            with ui.row().classes("file items-center"):
                ui.label(upload.own_name).classes("said").style("font-weight: 600; flex: 1 1 12rem")
                ui.button(icon="close", on_click=partial(self._remove, upload)).props(
                    f'flat dense round aria-label="remove {_attribute(upload.own_name)}"'
                ).set_enabled(not self.busy)
                said = ui.label(upload.said or "reading ...").classes("said").style("flex: 1 0 100%")
                said.classes("wrong" if upload.state is State.REFUSED else "soft")
                if upload.markers or not (upload.names_itself or upload.state is State.REFUSED):
                    self._labels(upload)

    def _labels(self, upload: Upload) -> None:
        """Draw the inputs for the labels of a file."""

        def put(key: str) -> Callable[[object], None]:
            def changed(event: object) -> None:
                upload.labels = replace(upload.labels, **{key: str(getattr(event, "value", "") or "").strip()})
                self._altered(upload)

            return changed

        with ui.element("div").classes("names"):
            ui.input("Subject", value=upload.labels.subject, on_change=put("subject")).props("dense")
            ui.input("Motion", value=upload.labels.motion, on_change=put("motion")).props("dense")
            ui.select(["right", "left"], label="Shoulder", value=upload.labels.side, on_change=put("side")).props(
                "dense"
            )
            if upload.markers:
                ui.input("Sampled at, degrees", value=upload.labels.at, on_change=put("at")).props("dense").tooltip(
                    "Elevations of the arm at which a trial is sampled. Empty: every frame is a posture."
                )

    def _altered(self, *uploads: Upload) -> None:
        """Mark files as altered since they were read."""
        for one in uploads:
            one.state = State.ALTERED
        self.reading.refresh()
        self.choices.refresh()

    async def _remove(self, upload: Upload) -> None:
        self.session.remove(upload)
        self.errors.clear()
        await self._read()

    @ui.refreshable_method
    def names(self) -> None:
        """Draw the assignment of markers to landmarks, where there are markers."""
        known = self.session.marker_names
        if not known:
            return
        options = self.session.options
        trials = [one for one in self.session.files if one.markers]
        unknown = any(one.state is State.REFUSED for one in trials)

        def put(key: str) -> Callable[[object], None]:
            return lambda event: (setattr(options, key, getattr(event, "value", "") or ""), self._altered(*trials))[0]

        def name(landmark: str) -> Callable[[object], None]:
            def changed(event: object) -> None:
                options.markers[landmark] = getattr(event, "value", "") or ""
                self._altered(*trials)

            return changed

        with ui.expansion(HEADING, value=unknown).classes("w-full").props("dense"):
            ui.label(
                "IJ, PX, C7, T8, TS, AI and AC are needed (AA may stand for AC). SC gives the clavicle; GH, EM and EL "
                "the elevation of the arm. A formula such as (a + b)/2 may be written too."
            ).classes("soft")
            with ui.element("div").classes("names"):
                for landmark in MARKERS:
                    value = options.markers.get(landmark) or None
                    choices = list(dict.fromkeys([*known, *([value] if value else [])]))
                    select = ui.select(
                        choices, label=landmark, value=value, clearable=True, new_value_mode="add-unique"
                    )
                    select.props("dense").on_value_change(name(landmark))
                ui.select(
                    {"": "as the file says", **{unit: unit for unit in UNITS_MM}}, label="Unit", value=options.unit
                ).props("dense").on_value_change(put("unit"))
                ui.select(
                    {"": "AC was marked", **{one: one for one in ROTATIONS}}, label="AC from AA", value=options.aa_to_ac
                ).props("dense").on_value_change(put("aa_to_ac"))
                ui.select(
                    {"": "SC was marked", **{one: one for one in OFFSETS}}, label="SC from IJ", value=options.sc_from_ij
                ).props("dense").on_value_change(put("sc_from_ij"))

    @ui.refreshable_method
    def reading(self) -> None:
        """Draw the button that reads the files again, or the progress of reading."""
        if self.busy == READING:
            ui.linear_progress(show_value=False).props("indeterminate").classes("w-full")
        elif self.session.altered:
            ui.button("Read again", icon="refresh", on_click=self._read_again).props("no-caps")

    @ui.refreshable_method
    def summary(self) -> None:
        """Draw the content of the motions, and warnings about them."""
        motions = self.session.motions
        if motions is None:
            ui.label("Reading ..." if self.busy else "Nothing yet.").classes("soft")
            return
        postures, subjects = len(motions.posture), len(motions.subjects)
        ui.label(f"{postures} postures of {subjects} subject{'s' if subjects > 1 else ''}").style("font-weight: 600")
        columns = {
            "subject": "Subject",
            "motions": "Motions (postures)",
            "elevation": "Elevation of the arm, degrees",
            "missing": "Not measured",
        }
        ui.table(
            columns=[{"name": key, "label": said, "field": key, "align": "left"} for key, said in columns.items()],
            rows=[vars(one) for one in subjects_read(motions)],
            row_key="subject",
            pagination=20 if subjects > 20 else None,
        ).props("flat dense wrap-cells").classes("w-full")
        found = warnings(motions)
        for text in found[:MOST_WARNINGS]:
            ui.label(self.session.named(text)).classes("said soft")
        if len(found) > MOST_WARNINGS:
            ui.label(f"... and {len(found) - MOST_WARNINGS} more").classes("soft")

    @ui.refreshable_method
    def choices(self) -> None:
        """Draw the parameter sets and the commands to run, or the running command."""
        if self.busy in COMMANDS:
            self._running()
            return
        ready = self.session.motions is not None and not self.busy and not self.session.altered
        ui.select(
            list(model_names()), multiple=True, value=self.models, label="Parameter sets", on_change=self._chosen
        ).props("use-chips").style("max-width: 34rem")
        ui.checkbox("Adapt each person's own bones too").bind_value(self, "own_bones")
        ui.label("Predicts a person's motion better. Without it six numbers are adapted, as in the thesis.").classes(
            "soft"
        )
        with ui.row().classes("items-center"):
            for text, commands in (("Adapt", COMMANDS[:1]), ("Adapt and diagnose", COMMANDS)):
                ui.button(text, on_click=partial(self._run, commands)).props("no-caps").set_enabled(
                    ready and bool(self.models)
                )
        if self.session.altered:
            ui.label("Names or options have changed: read the files again first.").classes("soft")
        elif self.session.motions is None and not self.busy:
            ui.label("Give files first.").classes("soft")

    def _chosen(self, event: object) -> None:
        self.models = list(getattr(event, "value", None) or [])
        self.choices.refresh()

    def _running(self) -> None:
        """Draw progress bar, stage, elapsed time and the button that cancels the command."""
        ui.linear_progress(show_value=False).props("indeterminate").classes("w-full")
        with ui.row().classes("items-center"):
            self.stage = ui.label(f"{TITLES[self.busy]}: starting").props("role=status")
            clock = ui.label("").classes("soft")
            ui.timer(1.0, lambda: clock.set_text(f"{time.monotonic() - self.since:.0f} s"))
            ui.button("Cancel", icon="stop", on_click=self.session.children.cancel).props("outline no-caps")

    async def _run(self, commands: tuple[str, ...]) -> None:
        """Run the commands one after another, until one of them fails."""
        if self.busy:
            return
        self._forget_results()
        for command in commands:
            self.busy, self.since = command, time.monotonic()
            self._refresh()
            ended = await self.session.run(command, self.models, self.own_bones, self._stage)
            self.busy = ""
            if not ended.useful or ended.said:
                self.outcome.append(f"{TITLES[command]}: {self.session.named(ended.message)}")
            if not ended.useful:
                break
            self.shown = command
        if self.session.waiting:  # a file arrived during the run
            await self._read()
        self._refresh()

    def _stage(self, stage: str) -> None:
        self.stage.set_text(f"{TITLES[self.busy]}: {stage}")

    @ui.refreshable_method
    def results(self) -> None:
        """Draw the report, and the button that downloads everything."""
        for text in self.outcome:
            ui.label(text).classes("wrong said").props("role=alert")
        there = [command for command in COMMANDS if not self.busy and self.session.report(command)]
        if not there:
            ui.label("Nothing yet.").classes("soft")
            return
        address = f"/session/{self.session.token}"
        with ui.row().classes("items-center justify-between w-full"):
            if len(there) > 1:
                ui.toggle({one: TITLES[one] for one in there}, value=self.shown, on_change=self._show).props("no-caps")
            ui.button(
                "Everything as a zip", icon="download", on_click=lambda: ui.download.from_url(f"{address}/{ZIP}", ZIP)
            ).props("no-caps")
        ui.html(
            f'<iframe class="report" title="Report" src="{address}/{self.shown}"></iframe>', sanitize=False
        ).classes("w-full")
        ui.link("The report in a window of its own", f"{address}/{self.shown}", new_tab=True)

    def _show(self, event: object) -> None:
        self.shown = str(getattr(event, "value", ""))
        self.results.refresh()


def _step(title: str) -> ui.card:
    """Create a card with its heading."""
    card = ui.card().classes("step").props("flat bordered")
    with card:
        ui.html(f"<h2>{title}</h2>", sanitize=False)
    return card


def _attribute(text: str) -> str:
    """Remove the characters that cannot stand inside the quotes of a prop."""
    return text.replace("\\", "").replace('"', "")
