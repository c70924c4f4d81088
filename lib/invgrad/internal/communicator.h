// Exchange of numbers between the processes (ranks) of one run.
//
//   rank 0 .. size - 1;   every rank calls the same functions in the same order
//
// All ranks get the same bits from every function, and the same bits in every
// run with as many ranks. lib/invgrad/mpi implements it by MPI. A null pointer
// stands for a run in one process.
//
// Cost:    stated for each function as the numbers that a rank sends.
// Fails:   never returns an error: if a rank is lost, all ranks end.
#ifndef INVGRAD_INTERNAL_COMMUNICATOR_H_
#define INVGRAD_INTERNAL_COMMUNICATOR_H_

#include <cstddef>
#include <string>
#include <vector>

#include "Eigen/Core"

namespace invgrad {

// A contiguous part of `total` items.
struct Share {
  int first = 0;
  int count = 0;
};

class Communicator {
 public:
  virtual ~Communicator() = default;

  virtual int rank() const = 0;
  virtual int size() const = 0;

  // Replaces the values by their sums over the ranks. Sends about 2 `size`.
  virtual void Sum(double* values, std::ptrdiff_t size) const = 0;

  // *own = this rank's part of the sums over the ranks of `values`, whose parts
  // have the sizes of `sizes`, rank after rank. Sends the parts of the others.
  virtual void SumParts(const double* values,
                        const std::vector<std::ptrdiff_t>& sizes,
                        double* own) const = 0;

  // Sets the values of all ranks to those of `root`. Sends `size`.
  virtual void Broadcast(int root,
                         double* values,
                         std::ptrdiff_t size) const = 0;

  // *all = the ranks' values, rank after rank; sizes[r] is the size of rank r's.
  // Sends the own values size() - 1 times.
  virtual void Gather(const double* own,
                      const std::vector<std::ptrdiff_t>& sizes,
                      double* all) const = 0;

  // The number of values that the functions above have sent from this rank, by
  // the counts above.
  virtual double num_sent() const = 0;

  // The share of rank r; shares differ by at most one item.
  Share ShareOf(int total, int r) const;
  // The sizes of the ranks' shares, with `per_item` numbers an item.
  std::vector<std::ptrdiff_t> SharedSizes(int total,
                                          std::ptrdiff_t per_item) const;
  Share OwnShare(int total) const { return ShareOf(total, rank()); }

  // Gathers the columns of all ranks' matrices side by side, where rank r has
  // those of its share of `total`, `per_item` columns an item.
  Eigen::MatrixXd GatherColumns(const Eigen::MatrixXd& own,
                                int total,
                                int per_item) const;

  // The texts of all ranks.
  std::vector<std::string> GatherTexts(const std::string& own) const;

  // Whether all ranks say yes. If not, *error is on all ranks the message of the
  // first rank that does not.
  bool Agree(bool ok, std::string* error) const;
};

}  // namespace invgrad

#endif  // INVGRAD_INTERNAL_COMMUNICATOR_H_
