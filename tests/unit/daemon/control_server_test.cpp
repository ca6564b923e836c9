// SPDX-License-Identifier: Apache-2.0
#include "daemon/control_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "config/model_file.h"
#include "config/rig.h"
#include "daemon/drive_change.h"
#include "daemon/rig_description.h"
#include "physics/problem.h"
#include "tests/unit/daemon/fakes.h"

namespace stickslip::daemon {
namespace {

using namespace std::chrono_literals;
using drivers::Outcome;
using drivers::Result;
using nlohmann::json;
using testing::HasSubstr;

config::Excitation shaking() {
  config::Excitation out;
  out.enabled = true;
  out.amplitude = 0.01;
  out.ramp_s = 0.01;
  return out;
}

/// A client that never blocks, so that client, server and loop can share a thread.
class Client {
 public:
  explicit Client(const std::filesystem::path& path) {
    file_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.string().copy(address.sun_path, sizeof address.sun_path - 1);
    connected = ::connect(file_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  }
  ~Client() { ::close(file_); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  /// Number of bytes that the socket accepted.
  std::size_t send(std::string_view text) {
    const ssize_t put = ::send(file_, text.data(), text.size(), MSG_NOSIGNAL);
    return put > 0 ? static_cast<std::size_t>(put) : 0;
  }
  /// Complete lines received.
  std::vector<json> lines() {
    std::array<char, 65536> part{};
    for (ssize_t got = 0; (got = ::recv(file_, part.data(), part.size(), 0)) >= 0;) {
      if (got == 0) {
        closed = true;
        break;
      }
      in_.append(part.data(), static_cast<std::size_t>(got));
    }
    if (errno == ECONNRESET) closed = true;
    std::vector<json> out;
    for (std::size_t end = 0; (end = in_.find('\n')) != std::string::npos; in_.erase(0, end + 1)) {
      out.push_back(json::parse(in_.substr(0, end)));
    }
    return out;
  }
  bool connected = false;
  bool closed = false;

 private:
  int file_ = -1;
  std::string in_;
};

class ControlTest : public testing::Test {
 protected:
  ControlTest() {
    folder = std::filesystem::temp_directory_path() /
             ("stickslip-control-" + std::to_string(::getpid()));
    std::filesystem::create_directory(folder);
    settings.path = folder / "control.sock";
    driver.keep_actuations = false;
    LoopSettings loop_settings;
    loop_settings.live.interlocks.dead_man_ns = 50'000'000;
    loop = std::make_unique<Loop>(driver, clock, loop_settings, Excitation(shaking()), nullptr,
                                  ledger, std::vector<Stream*>{});
    loop->begin();
    rig.excitation = shaking();
    rig.limits.displacement_m = 0.02;
    rig.limits.velocity_m_s = 1.0;
    rig.limits.acceleration_m_s2 = 50.0;
  }
  ~ControlTest() override { std::filesystem::remove_all(folder); }

  void open() {
    control = std::make_unique<ControlServer>(
        ListeningSocket(settings), settings, *loop, clock, 1000.0,
        ControlHandlers{.status =
                            [this] {
                              Status status = status_of(loop->snapshot(), ledger, loop->timing());
                              status.devices = loop->device_counts();
                              return status;
                            },
                        .refusal = [](const Setting& setting) -> std::optional<std::string> {
                          if (setting.value > 5.0) return "beyond limits.velocity_m_s";
                          return std::nullopt;
                        },
                        .was_set = [this](const Setting& setting) { latest_setting = setting; },
                        .describe = [this] { return description_of(rig); },
                        .note =
                            [this](const std::string& text, const std::string& about) {
                              if (about == "another rig") {
                                throw InputError(Problem{"", 0, 0, "the note is about another"});
                              }
                              notes.push_back(note_event(text, 42, 7));
                              return notes.back();
                            },
                        .reload = [] { return std::vector<std::string>{"nothing"}; },
                        .propose_model = [this](ModelFile file) { return propose(file); },
                        .model_answered =
                            [this](const Answer& answer) {
                              model_answers.push_back(answer);
                              return std::string(answer.accepted ? "taken" : "");
                            },
                        .propose_drive =
                            [this](DriveSamples samples) {
                              return drive_change.propose(rig, std::move(samples));
                            },
                        .drive_answered =
                            [this](const Answer& answer) {
                              const auto taken = drive_change.finish(answer);
                              if (taken) rig.excitation = *taken;
                              return taken ? changed_event(drive_change.samples(), answer).message
                                           : std::string();
                            }});
  }

  Command propose(const ModelFile& file) {
    if (file.text == "wrong") throw InputError(Problem{file.name, 12, 3, "mu is -1"});
    proposed.push_back(file);
    Command out;
    out.kind = Command::Kind::observe;
    out.observer = &observer;
    return out;
  }

  /// Server and loop, alternating.
  void run(int turns = 1) {
    for (int i = 0; i < turns; ++i) {
      control->serve(0ms, -1);
      loop->wait();
      loop->cycle();
    }
    control->serve(0ms, -1);
  }

  json ask(Client& client, const json& request, int turns = 4) {
    json whole = request;
    whole["v"] = 1;
    client.send(whole.dump() + "\n");
    for (int i = 0; i < turns; ++i) {
      run();
      for (json& line : client.lines()) {
        if (line.contains("ok")) return line;
      }
    }
    ADD_FAILURE() << "no answer to " << request;
    return {};
  }

  std::filesystem::path folder;
  LineServerSettings settings;
  test::FakeDriver driver;
  test::FakeClock clock;
  Ledger ledger;
  std::unique_ptr<Loop> loop;
  std::unique_ptr<ControlServer> control;
  Setting latest_setting;
  Observer observer{config::load_model(STICKSLIP_SOURCE_DIR "/config/models/simulated.toml"), 1e-3};
  std::vector<ModelFile> proposed;
  std::vector<Answer> model_answers;
  std::vector<Event> notes;
  config::Rig rig;
  DriveChange drive_change;
};

// Up to 4 mm and back, in a second.
json slow_drive() {
  json samples = json::array();
  for (int k = 0; k <= 100; ++k) samples.push_back(0.002 - 0.002 * std::cos(0.02 * M_PI * k));
  samples.front() = 0.0;
  samples.back() = 0.0;
  return {{"do", "drive"}, {"period_s", 0.01}, {"samples", samples}};
}

TEST_F(ControlTest, AnOperatorStartsAndStopsTheRig) {
  open();
  Client client(settings.path);
  json answer = ask(client, {{"do", "status"}, {"id", 5}});
  EXPECT_EQ(answer["id"], 5);
  EXPECT_EQ(answer["state"], "faulted");
  EXPECT_EQ(answer["interlock"], "just_started");
  EXPECT_EQ(ask(client, {{"do", "start"}})["ok"], false);
  EXPECT_EQ(ask(client, {{"do", "arm"}})["ok"], false);
  EXPECT_EQ(ask(client, {{"do", "clear"}})["state"], "idle");
  EXPECT_EQ(ask(client, {{"do", "start"}})["ok"], false);
  EXPECT_EQ(ask(client, {{"do", "arm"}})["state"], "armed");
  EXPECT_FALSE(driver.last.amplifier_on);
  EXPECT_EQ(ask(client, {{"do", "start"}})["state"], "running");
  run(30);
  EXPECT_TRUE(driver.last.amplifier_on);
  EXPECT_EQ(ask(client, {{"do", "stop"}})["state"], "stopping");
  run(30);
  EXPECT_FALSE(driver.last.amplifier_on);
  EXPECT_EQ(ask(client, {{"do", "status"}})["state"], "idle");
}

TEST_F(ControlTest, TheStatusHasTheCountsOfTheDevices) {
  driver.losses = 17;
  open();
  Client client(settings.path);
  const json answer = ask(client, {{"do", "status"}});
  EXPECT_EQ(answer["status"]["source"]["devices"]["fake"]["losses"], 17);
}

TEST_F(ControlTest, TheLogHasWhoAskedForWhatAndHowItEnded) {
  std::ostringstream text;
  const auto before = spdlog::default_logger();
  const auto sink = std::make_shared<spdlog::sinks::ostream_sink_mt>(text);
  spdlog::set_default_logger(std::make_shared<spdlog::logger>("test", sink));
  spdlog::set_pattern("%v");
  open();
  Client client(settings.path);
  ask(client, {{"do", "clear"}});
  ask(client, {{"do", "start"}, {"dead_man", true}});
  ask(client, {{"do", "set"}, {"key", "excitation.amplitude"}, {"value", 0.002}});
  ask(client, {{"do", "set"}, {"key", "excitation.amplitude"}, {"value", 7.5}});
  ask(client, {{"do", "frob\ncate"}});
  ask(client, {{"do", "reload"}});
  ask(client, {{"do", "status"}});
  for (int i = 0; i < 500; ++i) ask(client, {{"do", "arm"}, {"n", i}});
  spdlog::set_default_logger(before);
  const std::string who =
      "user " + std::to_string(::getuid()) + " (process " + std::to_string(::getpid()) + "): ";
  for (const char* const line :
       {"clear: accepted, the rig is idle\n",
        "start dead_man=true: refused: only an armed rig can be started\n",
        "set key=\"excitation.amplitude\" value=0.002: accepted, the rig is idle\n",
        "set key=\"excitation.amplitude\" value=7.5: refused: beyond limits.velocity_m_s\n",
        "frob\\ncate: refused: there is no command \"frob cate\"", "reload: accepted; nothing\n",
        "arm n=3: refused: only an idle rig can be armed\n"}) {
    EXPECT_THAT(text.str(), HasSubstr(who + line));
  }
  EXPECT_THAT(text.str(), testing::Not(HasSubstr("): status")));
  const std::string all = text.str();
  EXPECT_LT(std::count(all.begin(), all.end(), '\n'), 60);  // of 506
}

TEST_F(ControlTest, ABrokenInterlockPreventsClearingAndArmingWithItsReason) {
  open();
  Client client(settings.path);
  bool lost = true;
  driver.on_read = [&](std::uint64_t) {
    return lost ? Result{Outcome::needs_attention, "no permission on /dev/hidraw0"} : Result{};
  };
  run(3);
  const json refused = ask(client, {{"do", "clear"}});
  EXPECT_EQ(refused["ok"], false);
  EXPECT_THAT(refused["error"].get<std::string>(), HasSubstr("no permission on /dev/hidraw0"));
  lost = false;
  loop->device_restored();
  EXPECT_EQ(ask(client, {{"do", "clear"}})["state"], "idle");
  EXPECT_EQ(ask(client, {{"do", "arm"}})["state"], "armed");
}

TEST_F(ControlTest, ReleasingTheDeadMansHandleStopsTheRigImmediately) {
  open();
  for (const bool closes : {false, true}) {
    Client person(settings.path);
    auto holder = std::make_unique<Client>(settings.path);
    ask(person, {{"do", "clear"}});
    ask(person, {{"do", "arm"}});
    EXPECT_EQ(ask(*holder, {{"do", "start"}, {"dead_man", true}})["state"], "running");
    for (int i = 0; i < 20; ++i) {
      run(20);
      EXPECT_EQ(ask(*holder, {{"do", "alive"}})["state"], "running");
      EXPECT_EQ(ask(person, {{"do", "alive"}})["state"], "running");
    }
    // Requests of other clients do not count.
    if (closes) holder.reset();
    run(closes ? 3 : 51);
    EXPECT_EQ(ask(person, {{"do", "alive"}})["interlock"], "client_gone");
    EXPECT_FALSE(driver.last.amplifier_on);
    run(3);
  }
}

TEST_F(ControlTest, ChangesTheExcitationWithinItsLimits) {
  open();
  Client client(settings.path);
  EXPECT_EQ(ask(client, {{"do", "set"}, {"key", "excitation.carrier_hz"}, {"value", 3.5}})["ok"],
            true);
  EXPECT_EQ(latest_setting.tunable, Tunable::carrier_hz);
  EXPECT_EQ(latest_setting.value, 3.5);
  const json refused =
      ask(client, {{"do", "set"}, {"key", "excitation.carrier_hz"}, {"value", 50.0}});
  EXPECT_EQ(refused["error"], "beyond limits.velocity_m_s");
  EXPECT_EQ(latest_setting.value, 3.5);
  EXPECT_EQ(ask(client, {{"do", "set"}, {"key", "loop.rate_hz"}, {"value", 1.0}})["ok"], false);
  EXPECT_EQ(ask(client, {{"do", "set"}, {"key", "excitation.carrier_hz"}})["ok"], false);
}

TEST_F(ControlTest, AModelGoesToTheLoopAndItsAnswerToClientAndHandler) {
  open();
  Client client(settings.path);
  const json model = {{"do", "model"}, {"file", "mended.toml"}, {"text", "right"}};
  json answer = ask(client, model);
  EXPECT_EQ(answer["ok"], false);
  EXPECT_EQ(answer["error"],
            "the rig is faulted: the daemon has just started; inspect the rig, then clear");
  ask(client, {{"do", "clear"}});
  answer = ask(client, model);
  EXPECT_EQ(answer["ok"], true);
  EXPECT_EQ(answer["message"], "taken");
  EXPECT_EQ(answer["observer"]["kept"], 0);  // there was none before
  EXPECT_EQ(answer["sequence"], driver.sequence - 2);
  ASSERT_EQ(proposed.size(), 2U);
  EXPECT_EQ(proposed[1].name, "mended.toml");
  EXPECT_EQ(proposed[1].text, "right");
  ASSERT_EQ(model_answers.size(), 2U);
  EXPECT_FALSE(model_answers[0].accepted);
  EXPECT_TRUE(model_answers[1].accepted);
}

TEST_F(ControlTest, AWrongModelIsRefusedWithFileLineAndValue) {
  open();
  Client client(settings.path);
  ask(client, {{"do", "clear"}});
  const json answer = ask(client, {{"do", "model"}, {"file", "a.toml"}, {"text", "wrong"}});
  EXPECT_EQ(answer["error"], "a.toml:12:3: mu is -1");
  for (const json& wrong : {json{{"do", "model"}}, json{{"do", "model"}, {"file", "a.toml"}},
                            json{{"do", "model"}, {"file", 3}, {"text", "right"}}}) {
    EXPECT_THAT(ask(client, wrong)["error"].get<std::string>(), HasSubstr("a text")) << wrong;
  }
  EXPECT_TRUE(proposed.empty());
  EXPECT_TRUE(model_answers.empty());
}

// The observer is lent to the loop until it answers, whether or not the client waits.
TEST_F(ControlTest, TheAnswerReachesTheHandlerAlsoIfTheClientHasLeft) {
  open();
  {
    Client client(settings.path);
    client.send(json{{"v", 1}, {"do", "model"}, {"file", "a.toml"}, {"text", "right"}}.dump() +
                "\n");
    control->serve(0ms, -1);
    control->serve(0ms, -1);
  }
  run(3);
  EXPECT_EQ(model_answers.size(), 1U);
}

TEST_F(ControlTest, ADriveOfSamplesIsPlayedOnceAndEndsAtRest) {
  open();
  Client client(settings.path);
  EXPECT_EQ(ask(client, {{"do", "describe"}})["rig"]["limits"]["displacement_m"], 0.02);
  EXPECT_EQ(ask(client, slow_drive())["ok"], false) << "a faulted rig takes no drive";
  EXPECT_EQ(rig.excitation.kind, shaking().kind);
  ask(client, {{"do", "clear"}});
  const json taken = ask(client, slow_drive());
  EXPECT_EQ(taken["message"], "the drive is one of 101 samples over 1 s from the control socket");
  EXPECT_EQ(rig.excitation.kind, config::ExcitationKind::file);
  ask(client, {{"do", "arm"}});
  ask(client, {{"do", "start"}});
  double largest = 0.0;
  for (int i = 0; i < 500; ++i) {
    run();
    largest = std::max(largest, driver.last.drive);
  }
  EXPECT_NEAR(largest, 0.004, 1.0e-4);
  EXPECT_THAT(std::string(ask(client, slow_drive())["error"]), HasSubstr("idle or armed"));
  run(700);
  EXPECT_FALSE(driver.last.amplifier_on);
  EXPECT_EQ(ask(client, {{"do", "status"}})["state"], "idle");
  EXPECT_EQ(ask(client, {{"do", "drive"}})["message"], "the drive is the configured one again");
  EXPECT_EQ(rig.excitation.kind, shaking().kind);
}

TEST_F(ControlTest, ADriveBeyondTheLimitsOrWithoutNumbersIsRefused) {
  open();
  Client client(settings.path);
  ask(client, {{"do", "clear"}});
  const auto refusal = [&](const json& request) {
    return ask(client, request).value("error", std::string("accepted"));
  };
  json wrong = slow_drive();
  for (json& each : wrong["samples"]) each = 10.0 * each.get<double>();
  EXPECT_THAT(refusal(wrong), HasSubstr("limits.displacement_m"));
  wrong = slow_drive();
  wrong["samples"][3] = "a";
  EXPECT_THAT(refusal(wrong), HasSubstr("list of numbers"));
  wrong = slow_drive();
  wrong["samples"].back() = 1.0e-3;
  EXPECT_THAT(refusal(wrong), HasSubstr("end at rest"));
  wrong = slow_drive();
  wrong["period_s"] = 0.0;
  EXPECT_THAT(refusal(wrong), HasSubstr("period"));
  rig.excitation.enabled = false;
  EXPECT_THAT(refusal(slow_drive()), HasSubstr("excitation.enabled is false"));
  EXPECT_TRUE(drive_change.samples().values.empty());
}

// The next start does not play samples that a program left behind.
TEST_F(ControlTest, TheConfiguredDriveReturnsWhenTheClientOfAnotherLeaves) {
  open();
  Client other(settings.path);
  ask(other, {{"do", "clear"}});
  {
    Client client(settings.path);
    ask(client, slow_drive());
    ask(client, {{"do", "arm"}});
    ask(client, {{"do", "start"}, {"dead_man", true}});
    run(30);
    EXPECT_TRUE(driver.last.amplifier_on);
  }
  run(1500);  // the dead-man's handle was let go
  EXPECT_FALSE(driver.last.amplifier_on);
  EXPECT_EQ(rig.excitation.kind, config::ExcitationKind::file) << "not of a faulted rig";
  ask(other, {{"do", "clear"}});
  run(5);
  EXPECT_EQ(rig.excitation.kind, shaking().kind);
}

TEST_F(ControlTest, ANoteIsOneLineAboutThisRig) {
  open();
  Client client(settings.path);
  const json answer = ask(client, {{"do", "note"}, {"text", "weights: 450 g, \u00b5 lower"}});
  EXPECT_EQ(answer["ok"], true);
  EXPECT_EQ(answer["time_ns"], 42);
  EXPECT_EQ(answer["sequence"], 7);
  EXPECT_EQ(ask(client, {{"do", "note"}, {"text", "a"}, {"rig", "this rig"}})["ok"], true);
  ASSERT_EQ(notes.size(), 2U);
  EXPECT_EQ(notes[0].code, "note");
  EXPECT_EQ(notes[0].message, "weights: 450 g, \u00b5 lower");
  EXPECT_EQ(notes[0].severity, Severity::info);
  for (const json& wrong : {json{}, json{{"text", ""}}, json{{"text", "  "}}, json{{"text", 3}},
                            json{{"text", "two\nlines"}}, json{{"text", std::string(501, 'x')}},
                            json{{"text", "a"}, {"rig", "another rig"}}}) {
    json request = wrong;
    request["do"] = "note";
    const json refused = ask(client, request);
    EXPECT_EQ(refused["ok"], false) << wrong;
    EXPECT_FALSE(refused["error"].get<std::string>().empty());
  }
  EXPECT_EQ(notes.size(), 2U);
}

TEST_F(ControlTest, AveragesRawReadings) {
  open();
  driver.on_frame = [](Frame& frame) {
    frame.set(Channel::friction_force, frame.sequence % 2 == 0 ? 3.0 : 5.0);
  };
  Client client(settings.path);
  const json answer = ask(client, {{"do", "average"}, {"seconds", 0.1}}, 120);
  EXPECT_EQ(answer["average"]["frames"], 100);
  EXPECT_DOUBLE_EQ(answer["average"]["raw"]["friction_force"]["mean"].get<double>(), 4.0);
  for (const json& wrong : {json("1"), json(-1), json(0), json(1e9), json()}) {
    EXPECT_EQ(ask(client, {{"do", "average"}, {"seconds", wrong}})["ok"], false) << wrong;
  }
}

TEST_F(ControlTest, InvalidRequestsAreRefusedWithAReasonAndChangeNothing) {
  open();
  Client client(settings.path);
  const std::string deep(200, '[');
  for (const std::string& line :
       {std::string("hello"), std::string("[]"), std::string("{}"),
        std::string(R"({"v":2,"do":"clear"})"), std::string(R"({"v":1})"),
        std::string(R"({"v":1,"do":7})"), std::string(R"({"v":1,"do":"explode"})"),
        std::string(R"({"v":1,"id":"x","do":"clear"})"),
        std::string(R"({"v":1,"do":"start","dead_man":3})"), std::string("\xff\xfe\x00{", 4),
        deep}) {
    client.send(line + "\n");
    run(2);
    const auto answers = client.lines();
    ASSERT_EQ(answers.size(), 1U) << line;
    EXPECT_EQ(answers[0]["ok"], false) << line;
    EXPECT_NE(answers[0]["error"], "") << line;
  }
  EXPECT_EQ(loop->snapshot().state, RigState::faulted);
}

TEST_F(ControlTest, ThousandsOfMisbehavingClientsDelayNeitherTheLoopNorAValidClient) {
  open();
  std::mt19937 random(11);
  Client good(settings.path);
  run();
  std::vector<std::unique_ptr<Client>> bad;
  const std::string endless(40'000, 'x');
  int turns_waited = 0;
  for (int i = 0; i < 3000; ++i) {
    auto client = std::make_unique<Client>(settings.path);
    switch (random() % 5) {
      case 0:  // silent
        break;
      case 1:  // an unfinished line
        client->send("{\"v\":1,\"do\":\"sta");
        break;
      case 2:  // a line that is too long
        client->send(endless);
        client->send(endless);
        break;
      case 3: {  // noise
        std::string noise(1000, ' ');
        for (char& c : noise) c = static_cast<char>(random());
        client->send(noise);
        break;
      }
      default:  // sends requests and never reads
        for (int k = 0; k < 50; ++k) client->send("{\"v\":1,\"do\":\"status\"}\n");
    }
    bad.push_back(std::move(client));
    if (bad.size() > 200) bad.erase(bad.begin());
    if (i % 25 == 0) {
      good.send("{\"v\":1,\"do\":\"alive\"}\n");
      for (int turn = 0; turn < 20; ++turn) {
        run();
        if (!good.lines().empty()) break;
        ++turns_waited;
        ASSERT_LT(turn, 10) << "the good client is delayed";
        ASSERT_FALSE(good.closed);
      }
    }
    control->serve(0ms, -1);
  }
  EXPECT_LT(turns_waited, 120);
  EXPECT_EQ(loop->snapshot().state, RigState::faulted);
}

TEST_F(ControlTest, AClientThatHalfClosesGetsItsAnswer) {
  open();
  Client client(settings.path);
  client.send("{\"v\":1,\"id\":3,\"do\":\"clear\"}\n");
  run(4);
  EXPECT_EQ(client.lines().at(0)["state"], "idle");
}

TEST_F(ControlTest, TheSocketIsForTheGroupAndIsRemovedWithTheDaemon) {
  open();
  struct stat info {};
  ASSERT_EQ(::stat(settings.path.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777U, 0660U);
  EXPECT_THROW(open(), InputError);  // another server listens
  control.reset();
  EXPECT_FALSE(std::filesystem::exists(settings.path));
  // The stale socket of a killed daemon is replaced.
  const int stale = ::socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  settings.path.string().copy(address.sun_path, sizeof address.sun_path - 1);
  ASSERT_EQ(::bind(stale, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  ::close(stale);
  open();
  EXPECT_TRUE(Client(settings.path).connected);
  settings.path = folder / "no" / "folder";
  EXPECT_THROW(open(), InputError);
}

TEST_F(ControlTest, WatchersReceiveEventsAndStatus) {
  open();
  Client client(settings.path);
  ask(client, {{"do", "watch"}});
  Event event;
  event.code = "overrun";
  control->publish(event);
  control->publish(status_of(loop->snapshot(), ledger, loop->timing()));
  const auto lines = client.lines();
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_EQ(lines[0]["event"]["code"], "overrun");
  EXPECT_EQ(lines[1]["status"]["state"], "faulted");
}

}  // namespace
}  // namespace stickslip::daemon
