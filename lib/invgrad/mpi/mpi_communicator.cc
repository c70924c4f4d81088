#include <mpi.h>

#include <algorithm>
#include <cstdlib>
#include <iterator>
#include <limits>
#include <numeric>
#include <vector>

#include "invgrad/internal/logging.h"
#include "invgrad/mpi.h"

namespace invgrad {
namespace {

// MPI counts in int.
constexpr std::ptrdiff_t kLargestMessage = 1 << 28;

class MpiCommunicator final : public Communicator {
 public:
  MpiCommunicator() {
    MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
    MPI_Comm_size(MPI_COMM_WORLD, &size_);
  }

  int rank() const override { return rank_; }
  int size() const override { return size_; }
  double num_sent() const override { return num_sent_; }

  // Not MPI_Allreduce, which need not give all ranks the same bits: every sum is
  // made on one rank.
  void Sum(double* values, std::ptrdiff_t size) const override {
    Pieces(values, size, [this](double* piece, int count) {
      if (count >= kSmallestShared) {
        const std::vector<std::ptrdiff_t> sizes = SharedSizes(count, 1);
        std::vector<double> own(sizes[rank_]);
        SumParts(piece, sizes, own.data());
        Gather(own.data(), sizes, piece);
        return;
      }
      if (rank_ == 0) {
        MPI_Reduce(
            MPI_IN_PLACE, piece, count, MPI_DOUBLE, MPI_SUM, 0, MPI_COMM_WORLD);
      } else {
        MPI_Reduce(
            piece, nullptr, count, MPI_DOUBLE, MPI_SUM, 0, MPI_COMM_WORLD);
      }
      MPI_Bcast(piece, count, MPI_DOUBLE, 0, MPI_COMM_WORLD);
      num_sent_ += 2.0 * count;
    });
  }

  void SumParts(const double* values,
                const std::vector<std::ptrdiff_t>& sizes,
                double* own) const override {
    CHECK_EQ(static_cast<int>(sizes.size()), size_);
    const std::vector<int> counts = Counts(sizes);
    MPI_Reduce_scatter(
        values, own, counts.data(), MPI_DOUBLE, MPI_SUM, MPI_COMM_WORLD);
    num_sent_ += static_cast<double>(
        std::accumulate(sizes.begin(), sizes.end(), std::ptrdiff_t{0}) -
        sizes[rank_]);
  }

  void Broadcast(int root, double* values, std::ptrdiff_t size) const override {
    Pieces(values, size, [root](double* piece, int count) {
      MPI_Bcast(piece, count, MPI_DOUBLE, root, MPI_COMM_WORLD);
    });
    if (rank_ == root) num_sent_ += static_cast<double>(size);
  }

  void Gather(const double* own,
              const std::vector<std::ptrdiff_t>& sizes,
              double* all) const override {
    CHECK_EQ(static_cast<int>(sizes.size()), size_);
    num_sent_ += static_cast<double>(sizes[rank_]) * (size_ - 1);
    const std::ptrdiff_t total =
        std::accumulate(sizes.begin(), sizes.end(), std::ptrdiff_t{0});
    if (total > std::numeric_limits<int>::max()) {
      double* to = all;
      for (int r = 0; r < size_; ++r) {
        if (r == rank_) std::copy_n(own, sizes[r], to);
        Pieces(to, sizes[r], [r](double* piece, int count) {
          MPI_Bcast(piece, count, MPI_DOUBLE, r, MPI_COMM_WORLD);
        });
        to += sizes[r];
      }
      return;
    }
    const std::vector<int> counts = Counts(sizes);
    std::vector<int> offsets(size_, 0);
    std::partial_sum(counts.begin(), counts.end() - 1, offsets.begin() + 1);
    MPI_Allgatherv(own,
                   counts[rank_],
                   MPI_DOUBLE,
                   all,
                   counts.data(),
                   offsets.data(),
                   MPI_DOUBLE,
                   MPI_COMM_WORLD);
  }

 private:
  // From this size on, each rank sums a part.
  static constexpr int kSmallestShared = 4096;

  static std::vector<int> Counts(const std::vector<std::ptrdiff_t>& sizes) {
    for (const std::ptrdiff_t size : sizes) {
      CHECK_LE(size, std::numeric_limits<int>::max());
    }
    return {sizes.begin(), sizes.end()};
  }

  template <typename Function>
  static void Pieces(double* values,
                     std::ptrdiff_t size,
                     const Function& function) {
    for (std::ptrdiff_t first = 0; first < size; first += kLargestMessage) {
      function(values + first,
               static_cast<int>(std::min(kLargestMessage, size - first)));
    }
  }

  int rank_ = 0;
  int size_ = 1;
  mutable double num_sent_ = 0.0;
};

}  // namespace

bool IsLaunchedByMpi() {
  // Open MPI, PMIx (srun --mpi=pmix), MPICH and srun --mpi=pmi2.
  constexpr const char* kVariables[] = {
      "OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK"};
  return std::any_of(
      std::begin(kVariables), std::end(kVariables), [](const char* name) {
        return std::getenv(name) != nullptr;
      });
}

MpiSession::MpiSession(int* argc, char*** argv) {
  if (!IsLaunchedByMpi()) return;
  // Other threads (of Ceres, of the samples) do not call MPI.
  int provided = 0;
  MPI_Init_thread(argc, argv, MPI_THREAD_FUNNELED, &provided);
  CHECK_GE(provided, MPI_THREAD_FUNNELED) << "MPI does not support threads.";
  communicator_ = std::make_shared<MpiCommunicator>();
}

MpiSession::~MpiSession() {
  if (communicator_ != nullptr) MPI_Finalize();
}

}  // namespace invgrad
