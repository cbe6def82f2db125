// A job of several ranks, each a thread of the test.
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <filesystem>
#include <functional>
#include <mutex>
#include <thread>

#include "cairn/base/error.h"
#include "pipeline/machines/batch.h"
#include "pipeline/machines/memory_gate.h"
#include "support/test.h"
#include "support/thrown_message.h"
#include "unit/pipeline/wall_fixture.h"

namespace cairn {
namespace {
namespace fs = std::filesystem;

// The ranks' mailboxes. Rank 0 is the test's own thread.
class ThreadJob {
 public:
  explicit ThreadJob(int num_ranks) : mailboxes_(num_ranks) {
    for (int rank = 0; rank < num_ranks; ++rank) ranks_.emplace_back(*this, rank);
  }

  class Rank : public Peers {
   public:
    Rank(ThreadJob& job, int rank) : job_(job), rank_(rank) {}
    int rank() const override { return rank_; }
    int size() const override { return static_cast<int>(job_.mailboxes_.size()); }
    void Send(int to, std::string bytes) override {
      const std::lock_guard<std::mutex> lock(job_.mutex_);
      job_.mailboxes_[to].push_back({rank_, std::move(bytes)});
    }
    int64_t NumUnsentBytes() override { return 0; }
    std::optional<Message> Receive() override {
      const std::lock_guard<std::mutex> lock(job_.mutex_);
      std::deque<Message>& mailbox = job_.mailboxes_[rank_];
      if (mailbox.empty()) return std::nullopt;
      Message message = std::move(mailbox.front());
      mailbox.pop_front();
      if (rank_ == 0 && message.bytes[0] == static_cast<char>(MessageKind::kResults)) {
        ++job_.num_result_messages_;
      }
      return message;
    }
    void Pause() override { std::this_thread::sleep_for(std::chrono::microseconds(100)); }

   private:
    ThreadJob& job_;
    const int rank_;
  };

  // Rank 0 runs the pipeline, the others `help`. Rethrows what rank 0 throws.
  void Run(const BuildPipelineOptions& options, const RunContext& run,
           const std::function<void(Peers&)>& help = HelpToBuild) {
    std::vector<std::jthread> threads;
    for (size_t rank = 1; rank < ranks_.size(); ++rank) {
      threads.emplace_back([this, rank, &help] { help(ranks_[rank]); });
    }
    const struct Leave {
      Rank& rank0;
      ~Leave() {
        for (int to = 1; to < rank0.size(); ++to) rank0.Send(to, "");
      }
    } leave{ranks_[0]};
    RunBuildPipeline(options, run, &ranks_[0]);
  }

  int num_result_messages() const { return num_result_messages_; }

 private:
  std::mutex mutex_;
  std::vector<std::deque<Peers::Message>> mailboxes_;
  std::vector<Rank> ranks_;
  int num_result_messages_ = 0;
};

class MachinesTest : public WallTest {
 protected:
  MachinesTest() : WallTest(12, 4) {}
  BuildPipelineOptions Options(const std::string& database) const {
    BuildPipelineOptions options = WallTest::Options(database);
    options.inputs.verifier = VerifierChoice::kBoth;
    options.matching.max_ratio = 0.7;  // not the default: helpers have to be told
    return options;
  }
};

TEST_F(MachinesTest, DumpsAreEqualWithHelpers) {
  RunBuildPipeline(Options("alone.db"), {7, 1});
  for (const int num_ranks : {2, 4}) {
    const std::string database = std::to_string(num_ranks) + ".db";
    ThreadJob job(num_ranks);
    job.Run(Options(database), {7, 1});
    EXPECT_GT(job.num_result_messages(), 3);  // They did help.
    EXPECT_TRUE(Dump(database) == Dump("alone.db")) << num_ranks << " ranks";
  }
}

TEST_F(MachinesTest, LittleMemoryGivesTheSame) {
  RunBuildPipeline(Options("alone.db"));
  BuildPipelineOptions options = Options("little.db");
  options.scheduler.max_memory_gib = 0.001;  // A tile, and a helper, has few images.
  ThreadJob job(3);
  job.Run(options, {});
  EXPECT_TRUE(Dump("little.db") == Dump("alone.db"));
}

TEST_F(MachinesTest, ADamagedPhotographIsSkippedAsAlone) {
  fs::resize_file(folder_ / "images/photo3.png", 2000);
  RunBuildPipeline(Options("alone.db"));
  ThreadJob job(3);
  job.Run(Options("helped.db"), {});
  EXPECT_TRUE(Dump("helped.db") == Dump("alone.db"));
}

// Sends one message of its own where a helper would send results.
void HelpBadly(Peers& peers, const std::function<std::string(const std::string&)>& answer) {
  ByteSink hello;
  hello(MessageKind::kHello);
  hello(HelperHello::OfThisProcess());
  peers.Send(0, hello.Take());
  while (true) {
    const auto message = peers.Receive();
    if (message && message->bytes.empty()) return;
    if (message && message->bytes[0] == static_cast<char>(MessageKind::kTasks)) {
      peers.Send(0, answer(message->bytes));
    }
    if (!message) peers.Pause();
  }
}

std::string ErrorMessage(const std::string& text) {
  ByteSink error;
  error(MessageKind::kError);
  error.AddText(text);
  return error.Take();
}

TEST_F(MachinesTest, AHelperThatFailsEndsTheRunWithItsName) {
  ThreadJob job(3);
  const auto help = [](Peers& peers) {
    if (peers.rank() == 1) return HelpToBuild(peers);
    HelpBadly(peers, [](const std::string&) { return ErrorMessage("out of memory"); });
  };
  const std::string message = ThrownMessage<IoError>([&] {
    job.Run(Options("a.db"), {0, 1}, help);
  });
  EXPECT_THAT(message, HasSubstr("rank 2 on "));
  EXPECT_THAT(message, HasSubstr("out of memory"));
  // The next run goes on.
  RunBuildPipeline(Options("a.db"));
  RunBuildPipeline(Options("alone.db"));
  EXPECT_TRUE(Dump("a.db") == Dump("alone.db"));
}

TEST_F(MachinesTest, AHelperThatLeavesEndsTheRunWithItsName) {
  ThreadJob job(2);
  const auto help = [](Peers& peers) {
    HelpBadly(peers, [](const std::string&) { return std::string(); });
  };
  EXPECT_THAT(ThrownMessage<IoError>([&] {
                job.Run(Options("a.db"), {0, 1}, help);
              }),
              HasSubstr("left the job"));
}

TEST_F(MachinesTest, AHelperThatLeavesAtOnceEndsTheRunWithItsRank) {
  ThreadJob job(2);
  const auto help = [](Peers& peers) { peers.Send(0, ""); };
  EXPECT_THAT(ThrownMessage<IoError>([&] { job.Run(Options("a.db"), {}, help); }),
              HasSubstr("rank 1: left the job"));
}

TEST_F(MachinesTest, APhotographThatAHelperAloneCannotReadIsAnError) {
  ThreadJob job(2);
  const auto help = [](Peers& peers) {
    HelpBadly(peers, [](const std::string& bytes) {
      ByteSource source(bytes);
      source.Get<MessageKind>();
      if (source.Get<TaskKind>() != TaskKind::kExtract) return ErrorMessage("no photograph came");
      source.Get<std::vector<image_t>>();
      source.Get<int64_t>();
      source.Get<int64_t>();
      ByteSink result, results;
      result(PhotoResult{source.Get<PhotoTask>().item, "no such file", {}});
      results(MessageKind::kResults);
      results.AddText(result.Take());
      return results.Take();
    });
  };
  const std::string message = ThrownMessage<IoError>([&] {
    job.Run(Options("a.db"), {0, 1}, help);
  });
  EXPECT_THAT(message, HasSubstr("rank 1 on "));
  EXPECT_THAT(message, HasSubstr("photo"));
  EXPECT_THAT(message, HasSubstr("no such file"));
}

TEST_F(MachinesTest, AnotherBuildIsRefused) {
  ThreadJob job(3);
  const auto help = [](Peers& peers) {
    if (peers.rank() == 2) return HelpToBuild(peers);
    HelperHello hello = HelperHello::OfThisProcess();
    ++hello.build_hash;
    ByteSink message;
    message(MessageKind::kHello);
    message(hello);
    peers.Send(0, message.Take());
  };
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { job.Run(Options("a.db"), {}, help); }),
              HasSubstr("rank 1 on"));
}

// Ranks 1 and 3 share a machine, which is not rank 0's; rank 2 shares that.
TEST_F(MachinesTest, RanksThatShareAMachineShareItsMemory) {
  ThreadJob job(4);
  std::vector<int> num_on_machine(4);
  const auto help = [&](Peers& peers) {
    HelperHello hello = HelperHello::OfThisProcess();
    if (peers.rank() != 2) hello.host += "-other";
    ByteSink message;
    message(MessageKind::kHello, hello);
    peers.Send(0, message.Take());
    std::optional<Peers::Message> setup;
    while (!(setup = peers.Receive())) peers.Pause();
    ByteSource source(setup->bytes);
    source.Get<MessageKind>();
    num_on_machine[peers.rank()] = source.Get<HelperSetup>().num_on_machine;
    peers.Send(0, "");
  };
  EXPECT_THAT(ThrownMessage<IoError>([&] { job.Run(Options("a.db"), {}, help); }),
              HasSubstr("left the job"));
  EXPECT_THAT(num_on_machine, ElementsAre(0, 2, 2, 2));
}

template <class T>
T Received(const T& sent) {
  ByteSink sink;
  sink(sent);
  const std::string bytes = sink.Take();
  ByteSource source(bytes);
  T received = source.Get<T>();
  EXPECT_TRUE(source.IsAtEnd());
  return received;
}

TEST(MemoryGate, LetsInWhatThereIsMemoryFor) {
  struct Case {
    int64_t max_bytes, num_bytes;
    int most_at_once;
  };
  for (const auto& [max_bytes, num_bytes, most_at_once] :
       {Case{100, 40, 2}, Case{100, 1000, 1}, Case{0, 1000, 1}}) {
    MemoryGate gate(max_bytes);
    std::atomic<int> num_inside = 0, most = 0;
    {
      std::vector<std::jthread> threads;
      for (int i = 0; i < 8; ++i) {
        threads.emplace_back([&, bytes = num_bytes] {
          const MemoryGate::Pass pass(gate, bytes);
          const int now = ++num_inside;
          for (int seen = most; seen < now && !most.compare_exchange_weak(seen, now);) {
          }
          std::this_thread::sleep_for(std::chrono::milliseconds(5));
          --num_inside;
        });
      }
    }
    EXPECT_EQ(most, most_at_once);
  }
}

TEST(MachineMessages, OptionsArriveAsTheyWere) {
  HelperSetup setup;
  setup.seed = 5;
  setup.num_threads = 3;
  setup.num_on_machine = 2;
  setup.verifier = "both";
  setup.features.type = FeatureType::kSift;
  setup.features.peak_threshold = 0.1;
  setup.matching.cross_check = false;
  setup.verification.num_resamples = 17;
  const auto got = Received(setup);
  EXPECT_EQ(got.seed, 5u);
  EXPECT_EQ(got.num_threads, 3);
  EXPECT_EQ(got.num_on_machine, 2);
  EXPECT_EQ(got.verifier, "both");
  EXPECT_EQ(DumpOptions(got.features), DumpOptions(setup.features));
  EXPECT_EQ(DumpOptions(got.matching), DumpOptions(setup.matching));
  EXPECT_EQ(DumpOptions(got.verification), DumpOptions(setup.verification));
}

TEST(MachineMessages, AShortMessageIsABug) {
  ByteSink sink;
  sink(MatchResult{5, {{1, 2}, {3, 4}}});
  const std::string bytes = sink.Take();
  ByteSource source(std::string_view(bytes).substr(0, bytes.size() - 1));
  EXPECT_THROW(source.Get<MatchResult>(), BugError);
}

TEST(MachineMessages, PairsArriveAsTheyWere) {
  PairTask task;
  task.pair_id = ImagePairToPairId(3, 7);
  task.matches = {{1, 2}, {5, 6}};
  task.are_best_first = task.weigh_focals = true;
  task.input_hash = 12345;
  const auto got = Received(task);
  EXPECT_EQ(got.pair_id, task.pair_id);
  EXPECT_EQ(got.matches, task.matches);
  EXPECT_TRUE(got.are_best_first);
  EXPECT_TRUE(got.weigh_focals);
  EXPECT_EQ(got.input_hash, 12345u);
}

TEST(MachineMessages, ImagesArriveAsTheyWere) {
  PairImage image;
  image.camera = Camera::FromFocal(4, CameraModel::kOpenCV, 500, 640, 480);
  image.camera.has_prior_focal_length = true;
  image.keypoints = {{1, 2, 3, 4, 5, 6}, {7, 8}};
  image.depth = {{1.5f, 0.1f, 0.2f, true}, {}};
  image.descriptors = Descriptors::Random(37, 128);
  const auto got = Received(image);
  EXPECT_EQ(got.camera.camera_id, 4u);
  EXPECT_EQ(got.camera.model, CameraModel::kOpenCV);
  EXPECT_EQ(got.camera.width, 640);
  EXPECT_EQ(got.camera.height, 480);
  EXPECT_EQ(got.camera.params, image.camera.params);
  EXPECT_TRUE(got.camera.has_prior_focal_length);
  EXPECT_EQ(got.keypoints, image.keypoints);
  ASSERT_EQ(got.depth.size(), 2u);
  EXPECT_EQ(got.depth[0].ddepth_dy, 0.2f);
  EXPECT_FALSE(got.depth[1].is_valid);
  EXPECT_EQ(got.descriptors, image.descriptors);
}

// What is written into the database tells all that matters of an outcome.
TEST(MachineMessages, OutcomesArriveAsTheyWere) {
  PairOutcome outcome;
  outcome.pair_id = ImagePairToPairId(1, 2);
  outcome.input_hash = 99;
  outcome.num_matches = 40;
  outcome.winner = 1;
  outcome.focal_evidence = FocalEvidence{30, 20, 25};
  PairReport report;
  report.status = PairStatus::kTooFewInliers;
  report.num_inliers = 4;
  outcome.runs.push_back({"first", "step", report, 0.25});
  report.status = PairStatus::kVerified;
  report.geometry.config = TwoViewConfig::kCalibrated;
  report.geometry.cam2_from_cam1 =
      Rigid3d(Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5), Eigen::Vector3d(0.6, 0, 0.8));
  report.geometry.E = Eigen::Matrix3d::Random();
  report.geometry.H = Eigen::Matrix3d::Random();
  report.geometry.inlier_matches = {{1, 1}, {2, 3}};
  report.num_inliers = 2;
  report.num_iterations = 1'000'000'000'000;
  report.score = 12.5;
  report.residual_px = 0.3;
  report.triangulation_angle_deg = 4;
  outcome.runs.push_back({"second", "other_step", report, 0.5});
  const auto got = Received(outcome);

  const TempFolder folder;
  const auto write = [&folder](const std::string& name, const PairOutcome& written) {
    Database database(folder / name);
    database.WriteCamera(Camera::FromFocal(1, CameraModel::kPinhole, 500, 640, 480));
    database.WriteImage({1, "a", 1});
    database.WriteImage({2, "b", 1});
    WriteOutcome(database, written);
  };
  write("a.db", outcome);
  write("b.db", got);
  EXPECT_TRUE(DumpDatabase(folder / "a.db") == DumpDatabase(folder / "b.db"));
  EXPECT_EQ(got.RejectionReason(), outcome.RejectionReason());
  EXPECT_EQ(got.runs[1].seconds, 0.5);
}

PairTask TaskOf(image_t id1, image_t id2) {
  PairTask task;
  task.pair_id = ImagePairToPairId(id1, id2);
  task.image1 = task.image2 = std::make_shared<const PairImage>();
  return task;
}

// The ids of the images in a message, and those to be forgotten.
struct Sent {
  std::vector<image_t> forgotten, images;
};
Sent Read(const std::string& bytes) {
  ByteSource source(bytes);
  source.Get<MessageKind>();
  source.Get<TaskKind>();
  Sent sent;
  sent.forgotten = source.Get<std::vector<image_t>>();
  for (auto num = source.Get<int64_t>(); num > 0; --num) {
    sent.images.push_back(source.Get<image_t>());
    source.Get<PairImage>();
  }
  return sent;
}

TEST(TaskBatch, NoImageIsSentTwiceToAHelperThatHasIt) {
  HeldImages held(1'000'000);
  TaskBatch first(TaskKind::kVerify, held);
  first.Add(TaskOf(1, 2));
  first.Add(TaskOf(1, 3));
  first.Add(TaskOf(2, 3));
  EXPECT_THAT(Read(first.Finish()).images, ElementsAre(1, 2, 3));
  TaskBatch second(TaskKind::kVerify, held);
  second.Add(TaskOf(2, 3));
  second.Add(TaskOf(3, 4));
  EXPECT_THAT(Read(second.Finish()).images, ElementsAre(4));
  held.Clear();  // Another stage.
  TaskBatch third(TaskKind::kVerify, held);
  third.Add(TaskOf(3, 4));
  const Sent sent = Read(third.Finish());
  EXPECT_THAT(sent.forgotten, ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(sent.images, ElementsAre(3, 4));
}

TEST(TaskBatch, TheLongestUnusedImagesAreForgotten) {
  ByteSink image;
  image(image_t{1});
  image(PairImage());
  HeldImages held(3 * static_cast<int64_t>(image.size()));
  const auto send = [&held](image_t id1, image_t id2) {
    TaskBatch batch(TaskKind::kVerify, held);
    batch.Add(TaskOf(id1, id2));
    return Read(batch.Finish());
  };
  EXPECT_THAT(send(1, 2).forgotten, ElementsAre());
  EXPECT_THAT(send(1, 3).forgotten, ElementsAre());
  const Sent sent = send(3, 4);
  EXPECT_THAT(sent.forgotten, ElementsAre(2));
  EXPECT_THAT(sent.images, ElementsAre(4));
  EXPECT_THAT(send(2, 4).forgotten, ElementsAre(1));
}

}  // namespace
}  // namespace cairn
