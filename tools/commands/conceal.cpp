#include <algorithm>
#include <atomic>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "config/model_file.h"
#include "diagnosis/parallel/for_each.h"
#include "physics/problem.h"
#include "protocol/recording.h"
#include "protocol/sha256.h"
#include "tools/command_line/option_checks.h"
#include "tools/commands/commands.h"
#include "tools/concealment/concealment.h"
#include "tools/concealment/secret.h"
#include "tools/files/write_file.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;
using namespace files;

using namespace command_line;
using namespace files;

namespace {

namespace fs = std::filesystem;
using concealment::Order;

struct Arguments {
  std::string out;
  std::string truth;
  int count = 1;
  std::uint64_t seed = 0;
  bool seeded = false;
  std::string kind = "any";
  std::vector<std::string> effects;
  double duration_s = 30.0;
  int jobs = 0;
};

const std::map<std::string, Order::Kind> kinds = {{"any", Order::Kind::any},
                                                  {"null", Order::Kind::nothing},
                                                  {"single", Order::Kind::single},
                                                  {"pair", Order::Kind::pair},
                                                  {"unlisted", Order::Kind::unlisted}};

// Seeds of the cases of a set, far apart from one another (Steele's SplitMix).
std::uint64_t seed_of_case(std::uint64_t seed, std::uint64_t number) {
  std::uint64_t z = seed + 0x9e3779b97f4a7c15U * (number + 1);
  z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
  z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
  return (z ^ (z >> 31U)) >> 12U;  // a number that JSON holds exactly
}

int run(Arguments arguments) {
  for (const std::string& id : arguments.effects) {
    if (concealment::secret_named(id) != nullptr) continue;
    std::string known;
    for (const auto& secret : concealment::all_secrets()) {
      known += (known.empty() ? "" : ", ") + std::string(secret.id);
    }
    throw InputError(
        Problem{"--effect", 0, 0, "cannot hide \"" + id + "\"; expected one of " + known});
  }
  const fs::path out = arguments.out;
  const fs::path truth = arguments.truth.empty() ? out / "truth" : fs::path(arguments.truth);
  // Nobody's earlier set is mixed with this one.
  if (fs::is_directory(out) && !fs::is_empty(out)) {
    throw InputError(Problem{out.string(), 0, 0, "is not empty; expected a new folder"});
  }
  if (fs::is_directory(truth) && !fs::is_empty(truth)) {
    throw InputError(Problem{truth.string(), 0, 0,
                             "is not empty; expected a new folder: the truth of another set is "
                             "not written over"});
  }
  make_folder(out);
  make_folder(truth);
  if (!arguments.seeded) {
    // Without a seed nobody knows what is hidden, not even who called.
    std::random_device device;
    arguments.seed = (static_cast<std::uint64_t>(device()) << 20U) ^ device();
  }
  const auto count = static_cast<std::size_t>(arguments.count);
  Order order;
  order.kind = kinds.at(arguments.kind);
  order.ids = arguments.effects;
  order.duration_s = arguments.duration_s;
  terminal::Progress progress("concealing");
  std::atomic<std::size_t> done = 0;
  parallel::for_each(count, parallel::threads_for(arguments.jobs), [&](std::size_t i) {
    char name[32];
    std::snprintf(name, sizeof name, "case-%03zu", i + 1);
    const concealment::Case made =
        concealment::conceal(order, seed_of_case(arguments.seed, i), name);
    const fs::path folder = out / name;
    make_folder(folder);
    protocol::write_recording(made.recording, folder / "recording.csv");
    protocol::write_recording(made.validation, folder / "validation.csv");
    write_file(folder / "model.toml", config::model_text(made.believed));
    const std::string sealed = concealment::truth_text(made.truth);
    write_file(truth / (std::string(name) + ".json"), sealed);
    write_file(folder / "seal.txt",
               "SHA-256 of the truth file: " + protocol::sha256_of(sealed) + "\n");
    progress.at(done.fetch_add(1) + 1, count);
  });
  progress.finish();
  std::printf("%zu concealed recordings in %s, their truth in %s\n", count, out.c_str(),
              truth.c_str());
  return 0;
}

}  // namespace

void add_conceal(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "conceal", "Make recordings in which physics is hidden, to examine a diagnosis blind");
  command->add_option("--out", arguments->out, "A new folder for the set")->required();
  command->add_option("--truth", arguments->truth,
                      "Folder for the truth files (default: truth in that folder); each case holds "
                      "the seal (SHA-256) of its own");
  command->add_option("--count", arguments->count, "How many recordings")
      ->check(whole_number(1, 999))
      ->capture_default_str();
  CLI::Option* seed =
      command->add_option("--seed", arguments->seed, "Seed (default: drawn, and told to nobody)")
          ->check(seed_number());
  command->add_option("--kind", arguments->kind, "What to hide")
      ->check(CLI::IsMember(kinds))
      ->capture_default_str();
  command->add_option("--effect", arguments->effects,
                      "Hide one of these (an effect's id; default: any that fits the kind)");
  command->add_option("--duration", arguments->duration_s, "About how long a recording is [s]")
      ->check(CLI::Range(10.0, 600.0))
      ->capture_default_str();
  command->add_option("--jobs", arguments->jobs, "Threads (0: as many as there are cores)")
      ->check(number_of_threads());
  command->callback([&action, arguments, seed] {
    arguments->seeded = seed->count() > 0;
    action = [arguments] { return run(*arguments); };
  });
}

}  // namespace stickslip::commands
