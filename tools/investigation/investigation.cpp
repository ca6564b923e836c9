// SPDX-License-Identifier: Apache-2.0
#include "tools/investigation/investigation.h"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "config/model_file.h"
#include "diagnosis/report/html.h"
#include "diagnosis/report/json.h"
#include "diagnosis/report/provenance.h"
#include "physics/problem.h"
#include "protocol/json_text.h"
#include "protocol/recording.h"
#include "protocol/sha256.h"
#include "tools/files/read_file.h"
#include "tools/investigation/campaign.h"
#include "tools/investigation/decision.h"
#include "tools/investigation/page.h"
#include "tools/investigation/questions.h"

namespace stickslip::investigation {

namespace {

namespace fs = std::filesystem;

std::string run_name(std::size_t number) {
  char out[16];
  std::snprintf(out, sizeof out, "run-%02zu", number);
  return out;
}

void write_state(const Study& study, const fs::path& folder) {
  save(study, folder);
  write_whole(folder / "campaign.toml", campaign_text(study));
  write_whole(folder / "study.html", page_of(study));
}

DiagnosisOptions diagnosis_options(const Dialogue& dialogue, const InvestigationOptions& options) {
  return {options.threads, options.stop, dialogue.progress};
}

QuestionOptions question_options(const Dialogue& dialogue, const InvestigationOptions& options) {
  QuestionOptions out{options.threads, options.stop, {}};
  if (dialogue.progress) {
    out.progress = [&dialogue](double done) { dialogue.progress("designing the next run", done); };
  }
  return out;
}

std::optional<NextRun> question_after(const Study& study, std::size_t steps, const fs::path& folder,
                                      const std::optional<diagnosis::Diagnosis>& result,
                                      const QuestionOptions& options) {
  if (steps == 0) return first_run(study, config::load_model(model_file(folder)), options);
  if (is_named(study, steps)) return std::nullopt;
  return next_run(study, steps, *result, options);
}

// The reports of a diagnosis in the folder of the run after which it was made.
void write_reports(const Study& study, const fs::path& folder, const Step& step,
                   const diagnosis::Diagnosis& result) {
  std::vector<report::Provenance::File> recordings;
  for (const Step& each : study.steps) {
    recordings.push_back({each.name + "/recording.csv", each.recording_sha256});
  }
  report::Provenance provenance =
      report::provenance_of(recordings, {"model.toml", study.model_sha256}, study.settings.seed);
  if (study.steps.size() > 1) {
    provenance.command =
        "stickslip diagnose --campaign campaign.toml --seed " + std::to_string(study.settings.seed);
  }
  const std::string mended = config::model_text(result.model);
  provenance.augmented_model = mended;
  const fs::path place = folder / step.name;
  write_whole(place / "mended.toml", mended);
  write_whole(place / "report.json",
              protocol::json_text(report::report_json(result, provenance)) + "\n");
  write_whole(place / "report.html", report::report_html(result, provenance));
}

Step made(const Study& study, const fs::path& folder, const NextRun& next, Rig& rig,
          const Dialogue& dialogue, const InvestigationOptions& options) {
  Step out;
  out.name = run_name(study.steps.size() + 1);
  out.question = next.question;
  write_whole(folder / out.name / "drive.svg", picture_of(next.drive, next.question, study.facts));
  dialogue.show(question_text(next.question, study.facts) +
                "  picture: " + (folder / out.name / "drive.svg").string() + "\n");
  if (!dialogue.confirm()) {
    out.name.clear();
    return out;
  }
  const auto waiting = [&dialogue](const std::string& command) {
    dialogue.show("waiting for a person to arm the rig: " + command + "\n");
  };
  const protocol::Recording recording = rig.run(next.drive, options.stop, waiting);
  // Written beside its place first, so that a recording is whole or absent.
  const fs::path file = recording_file(folder, out);
  const fs::path part = file.parent_path() / "recording-part.csv";
  protocol::write_recording(recording, part);
  fs::rename(part, file);
  out.recording_sha256 = protocol::sha256_of(files::content_of(file));
  return out;
}

void check_same(const std::string& file, const std::string& what, bool same) {
  if (same) return;
  throw InputError(Problem{file, 0, 0,
                           "is a study of another " + what +
                               "; give the same one to take it up again, or another --out"});
}

}  // namespace

Study opened(const fs::path& folder, const std::string& model_text, const RigFacts& facts,
             const StudySettings& settings) {
  const std::string sha256 = protocol::sha256_of(model_text);
  if (fs::exists(json_file(folder))) {
    Study out = read_study(folder);
    check_same(json_file(folder).string(), "model", out.model_sha256 == sha256);
    check_same(json_file(folder).string(), "rig",
               out.facts.name == facts.name && out.facts.rate_hz == facts.rate_hz);
    // A rig whose limits were changed since is driven within the present ones.
    out.facts = facts;
    out.settings.budget_s = settings.budget_s;
    out.ending = Ending::open;
    out.ending_words.clear();
    return out;
  }
  if (fs::exists(folder) && (!fs::is_directory(folder) || !fs::is_empty(folder))) {
    throw InputError(Problem{folder.string(), 0, 0,
                             "is no study and not empty; expected a new folder, or one that this "
                             "command has made"});
  }
  Study out;
  out.rig = facts.name;
  out.facts = facts;
  out.settings = settings;
  out.model_sha256 = sha256;
  write_whole(model_file(folder), model_text);
  write_state(out, folder);
  return out;
}

Study investigate(Study study, const fs::path& folder, Rig& rig, const Dialogue& dialogue,
                  const InvestigationOptions& options) {
  std::optional<diagnosis::Diagnosis> result;
  for (;;) {
    const std::size_t steps = study.steps.size();
    if (steps > 0 && (!study.steps.back().answered || !result)) {
      result = diagnosed(study, folder, steps, diagnosis_options(dialogue, options));
      study.steps.back() = answered(study.steps.back(), *result);
      write_reports(study, folder, study.steps.back(), *result);
      write_state(study, folder);
      dialogue.show(answer_text(study.steps.back()));
    }
    const auto next =
        question_after(study, steps, folder, result, question_options(dialogue, options));
    const Decision decision = decide(study, steps, next);
    study.ending = decision.ending;
    study.ending_words = decision.words;
    if (study.ending != Ending::open) break;
    const Step step = made(study, folder, *next, rig, dialogue, options);
    if (step.name.empty()) {
      study.ending = Ending::declined;
      study.ending_words = "a run was declined: " + next->question.words;
      break;
    }
    study.steps.push_back(step);
    result.reset();
    write_state(study, folder);
  }
  write_state(study, folder);
  return study;
}

std::vector<std::string> differences(const fs::path& folder, const Dialogue& dialogue,
                                     const InvestigationOptions& options) {
  const Study study = read_study(folder);
  std::vector<std::string> out;
  const auto compare = [&out](const std::string& what, const std::string& was,
                              const std::string& is) {
    if (was != is) out.push_back(what + ": " + was + " in study.json, " + is + " now");
  };
  compare("model.toml", study.model_sha256,
          protocol::sha256_of(files::content_of(model_file(folder))));
  // Each state of the study as it was, with its numbers as JSON.
  Study again = study;
  std::optional<diagnosis::Diagnosis> result;
  for (std::size_t steps = 0; steps <= study.steps.size(); ++steps) {
    again.steps = {study.steps.begin(), study.steps.begin() + static_cast<std::ptrdiff_t>(steps)};
    if (steps > 0) {
      const Step& then = study.steps[steps - 1];
      if (!then.answered) break;
      compare(then.name + "/recording.csv", then.recording_sha256,
              protocol::sha256_of(files::content_of(recording_file(folder, then))));
      result = diagnosed(again, folder, steps, diagnosis_options(dialogue, options));
      again.steps.back() = answered(then, *result);
      dialogue.show(answer_text(again.steps.back()));
      Study was = again;
      was.steps.back() = then;
      if (study_text(was) != study_text(again)) {
        compare(then.name, answer_text(then), answer_text(again.steps.back()));
        if (answer_text(then) == answer_text(again.steps.back())) {
          out.push_back(then.name + ": the last digits of its numbers differ");
        }
      }
    }
    if (steps == study.steps.size()) break;
    const auto next =
        question_after(again, steps, folder, result, question_options(dialogue, options));
    const Step& made_then = study.steps[steps];
    compare(made_then.name + ", its question", question_text(made_then.question, study.facts),
            next ? question_text(next->question, study.facts) : std::string("none"));
  }
  return out;
}

}  // namespace stickslip::investigation
