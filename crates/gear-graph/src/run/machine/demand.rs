//! What an output needs, when the store does not know it.

use std::panic::{AssertUnwindSafe, catch_unwind};

use super::{Machine, Phase};
use crate::node::KnownPort;
use crate::run::jobs::Trouble;
use crate::store::{Need, Record};
use crate::{Demand, Known, NodeError};

impl Machine<'_> {
    /// Nothing is known at the key: ask the node, first without values.
    pub(super) fn decide(&mut self, slot: u32) {
        let (_, lazy) = self.wired(slot);
        let open = lazy & !self.slots[slot as usize].demanded;
        if open == 0 {
            self.want_values(slot, Phase::ValuesToRun);
            return;
        }
        if !self.run.elision {
            self.ask(slot, open);
            return;
        }
        match self.demand_unseen(slot, self.slots[slot as usize].demanded) {
            Err(NodeError::Unknown { .. }) => self.want_values(slot, Phase::ValuesToDecide),
            Ok(demand) => self.decided(slot, Ok(demand)),
            Err(error) => self.decided(slot, Err(Trouble::Error(error))),
        }
    }

    /// What the node demands, asked without letting it see any value: `Unknown` if it wants to.
    pub fn demand_unseen(&self, slot: u32, demanded: u64) -> Result<Demand, NodeError> {
        let unknown = || NodeError::Unknown { port: String::new() };
        let Some(node) = self.graph.node_at(self.site_of(slot)) else {
            return Ok(Demand::ready());
        };
        let known = Known::new(self.known_ports(slot, demanded), Box::new(move |_| Err(unknown())));
        let answer = AssertUnwindSafe(|| node.node.demand(self.graph.port_name(slot), &known));
        // After a panic, ask again where panics are caught with their message.
        catch_unwind(answer).unwrap_or_else(|_| Err(unknown()))
    }

    pub(super) fn known_ports(&self, slot: u32, demanded: u64) -> Vec<KnownPort> {
        let (always, lazy) = self.wired(slot);
        self.ports(slot)
            .iter()
            .enumerate()
            .map(|(i, port)| KnownPort {
                name: port.name,
                lazy: port.lazy,
                wired: (always | lazy) & (1 << i) != 0,
                known: demanded & (1 << i) != 0,
            })
            .collect()
    }

    /// The node has answered.
    pub fn decided(&mut self, slot: u32, answer: Result<Demand, Trouble>) {
        match answer {
            Err(trouble) => self.fail(slot, trouble),
            Ok(Demand::Ready { reason }) => {
                self.slot(slot).reason = reason.into();
                self.want_values(slot, Phase::ValuesToRun);
            }
            Ok(Demand::Need { ports, reason }) => match self.needed(slot, &ports) {
                Some(bits) => {
                    if let (Some(key), true) = (self.slots[slot as usize].key, self.cacheable(slot)) {
                        self.publish(Record::Need(Need {
                            key,
                            ports: ports.iter().map(ToString::to_string).collect(),
                            reason: reason.into(),
                        }));
                    }
                    self.ask(slot, bits);
                }
                None => self.fail(
                    slot,
                    Trouble::Error(NodeError::new(format!(
                        "`demand` asks for {ports:?}; it may ask only for lazy ports that are wired and not known yet, \
                         and for at least one"
                    ))),
                ),
            },
        }
    }
}
